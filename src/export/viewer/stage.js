// The canvas: renderer, light, ground, and drawing only when something has changed (a phone's battery).
import * as THREE from "three";

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: false });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.scene = new THREE.Scene();
    // Orthographic: the front view then lies on the film pixel on pixel. Zoom is CSS pixels per model pixel.
    this.camera = new THREE.OrthographicCamera();
    this.scene.add(this.camera, new THREE.HemisphereLight(0xffffff, 0xb8b2a0, 2.1));
    const sun = new THREE.DirectionalLight(0xfff4e0, 1.9);
    sun.position.set(-0.6, 0.9, 1);
    this.camera.add(sun);
    this.beforeDraw = [];
    this.onResize = [];
    this.asked = false;
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    // Phones take the graphics away from a page that is not looked at.
    canvas.addEventListener("webglcontextrestored", () => this.ask());
    this.resize();
  }

  resize() {
    const { clientWidth: w, clientHeight: h } = this.canvas.parentElement;
    if (!w || !h || (w === this.width && h === this.height)) return;
    this.width = w;
    this.height = h;
    this.renderer.setSize(w, h, false);
    Object.assign(this.camera, { left: -w / 2, right: w / 2, top: h / 2, bottom: -h / 2 });
    this.camera.updateProjectionMatrix();
    this.onResize.forEach((f) => f());
    // At once: a canvas that has a new size is empty until it is drawn.
    this.draw();
  }

  draw() {
    this.beforeDraw.forEach((f) => f());
    this.renderer.render(this.scene, this.camera);
  }

  ask() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.draw();
    });
  }
}

// Rings on the ground, by which the eye tells where the tree stands when it turns.
export function ground(radius) {
  const points = [];
  for (const r of [0.25, 0.5, 0.75, 1]) {
    for (let k = 0; k < 96; k++) {
      for (const j of [k, k + 1]) {
        const a = (2 * Math.PI * j) / 96;
        points.push(r * radius * Math.cos(a), 0, r * radius * Math.sin(a));
      }
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
  return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: 0xd8d5c8 }));
}
