// Where one looks from: orbit by mouse, finger and keys; front, side and top.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

// Azimuth and height of the eye, radians. The side view is from the viewer's right; from the top the front is below.
const FROM = { front: [0, 0], side: [Math.PI / 2, 0], top: [0, Math.PI / 2 - 1e-4] };
const MARGIN = 0.06;

export class Views {
  constructor(stage, box) {
    this.stage = stage;
    this.box = box;
    this.radius = box.getSize(new THREE.Vector3()).length() / 2 || 1;
    const controls = (this.controls = new OrbitControls(stage.camera, stage.canvas));
    Object.assign(stage.camera, { near: 0.01 * this.radius, far: 12 * this.radius });
    controls.zoomToCursor = true;
    this.name = null;
    this.frame = null;
    this.onChange = [];
    this.placing = false;
    controls.addEventListener("start", () => cancelAnimationFrame(this.gliding));
    controls.addEventListener("change", () => {
      // Moved by hand: it is none of the three views any more.
      if (!this.placing) this.name = null;
      this.onChange.forEach((f) => f());
      stage.ask();
    });
    stage.onResize.push(() => this.name && this.show(this.name, false));
  }

  // The rectangle in the front plane that the front view must hold, or null for the tree itself.
  setFrame(rectangle) {
    this.frame = rectangle;
  }

  // Angle between the eye and the front view, radians.
  awayFromFront() {
    return this.stage.camera.getWorldDirection(new THREE.Vector3()).angleTo(new THREE.Vector3(0, 0, -1));
  }

  show(name, glide = true) {
    const goal = this.goal(name);
    this.name = name;
    this.onChange.forEach((f) => f());
    cancelAnimationFrame(this.gliding);
    if (!glide || matchMedia("(prefers-reduced-motion: reduce)").matches) {
      this.place(goal);
      return;
    }
    const from = this.present();
    // The short way round.
    from.azimuth -= 2 * Math.PI * Math.round((from.azimuth - goal.azimuth) / (2 * Math.PI));
    const start = performance.now();
    const step = (now) => {
      const t = Math.min(1, Math.max(0, (now - start) / 320));
      const s = t * t * (3 - 2 * t);
      const mix = (a, b) => a + s * (b - a);
      this.place({
        azimuth: mix(from.azimuth, goal.azimuth),
        height: mix(from.height, goal.height),
        zoom: from.zoom * (goal.zoom / from.zoom) ** s,
        target: from.target.clone().lerp(goal.target, s),
      });
      if (t < 1) this.gliding = requestAnimationFrame(step);
    };
    this.gliding = requestAnimationFrame(step);
  }

  // Radians round the tree and upwards, and a factor to the zoom.
  turn(azimuth, height, zoom = 1) {
    cancelAnimationFrame(this.gliding);
    this.name = null;
    const now = this.present();
    const limit = Math.PI / 2 - 1e-4;
    now.azimuth += azimuth;
    now.height = Math.max(-limit, Math.min(limit, now.height + height));
    now.zoom *= zoom;
    this.place(now);
  }

  goal(name) {
    const { width, height } = this.stage;
    const [azimuth, elevation] = FROM[name];
    const size = this.box.getSize(new THREE.Vector3());
    const target = this.box.getCenter(new THREE.Vector3());
    let wide = [size.x, size.z, size.x][["front", "side", "top"].indexOf(name)] * (1 + 2 * MARGIN);
    let high = (name === "top" ? size.z : size.y) * (1 + 2 * MARGIN);
    if (name === "front" && this.frame) {
      const { left, right, top, bottom } = this.frame;
      target.set((left + right) / 2, (top + bottom) / 2, 0);
      [wide, high] = [right - left, top - bottom];
    }
    const zoom = Math.min(width / Math.max(wide, 1e-6), height / Math.max(high, 1e-6));
    return { azimuth, height: elevation, zoom, target };
  }

  present() {
    const { camera } = this.stage;
    const spherical = new THREE.Spherical().setFromVector3(camera.position.clone().sub(this.controls.target));
    return {
      azimuth: spherical.theta,
      height: Math.PI / 2 - spherical.phi,
      zoom: camera.zoom,
      target: this.controls.target.clone(),
    };
  }

  place({ azimuth, height, zoom, target }) {
    const { camera } = this.stage;
    const eye = new THREE.Vector3().setFromSphericalCoords(5 * this.radius, Math.PI / 2 - height, azimuth);
    camera.position.copy(target).add(eye);
    camera.zoom = zoom;
    this.controls.target.copy(target);
    camera.updateProjectionMatrix();
    this.placing = true;
    this.controls.update();
    this.placing = false;
    this.onChange.forEach((f) => f());
    this.stage.ask();
  }
}
