// The skeleton as lines of the same width at any zoom, and the chosen branch over everything.
import * as THREE from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";

function lines(options, order) {
  // Over the mesh: who asks for the skeleton wants to see it.
  const material = new LineMaterial({ depthTest: false, transparent: true, ...options });
  const object = new LineSegments2(new LineSegmentsGeometry(), material);
  object.frustumCulled = false;
  object.renderOrder = order;
  object.visible = false;
  return object;
}

export class Skeleton {
  constructor(tree) {
    this.tree = tree;
    // White along each side keeps them legible on wood and on the film.
    this.sides = lines({ linewidth: 4.5, color: 0xffffff, opacity: 0.75 }, 9);
    this.all = lines({ linewidth: 2.5, vertexColors: true }, 10);
    this.halo = lines({ linewidth: 9, color: 0xffffff }, 11);
    this.mark = lines({ linewidth: 5, color: 0xd9480f }, 12);
    this.object = new THREE.Group().add(this.sides, this.all, this.halo, this.mark);
    this.positions = new Float32Array(6 * tree.branches.length);
    this.colours = new Float32Array(6 * tree.branches.length);
    this.chosen = -1;
    this.update();
  }

  update() {
    const [a, b] = [new THREE.Vector3(), new THREE.Vector3()];
    this.tree.branches.forEach((branch, i) => {
      this.tree.segment(branch, a, b);
      a.toArray(this.positions, 6 * i);
      b.toArray(this.positions, 6 * i + 3);
    });
    if (this.positions.length === 0) return;
    fill(this.all.geometry, this.positions);
    fill(this.sides.geometry, this.positions);
    if (this.chosen >= 0) {
      const one = this.positions.slice(6 * this.chosen, 6 * this.chosen + 6);
      fill(this.halo.geometry, one);
      fill(this.mark.geometry, one);
    }
  }

  // `colourOf(branch)` gives a THREE.Color.
  paint(colourOf) {
    this.tree.branches.forEach((branch, i) => {
      colourOf(branch).toArray(this.colours, 6 * i);
      colourOf(branch).toArray(this.colours, 6 * i + 3);
    });
    if (this.colours.length) this.all.geometry.setColors(this.colours);
  }

  show(on) {
    // A tree of one node has no lines.
    this.all.visible = this.sides.visible = on && this.positions.length > 0;
  }

  choose(id) {
    this.chosen = this.tree.branches.findIndex((b) => b.id === id);
    this.halo.visible = this.mark.visible = this.chosen >= 0;
    this.update();
  }
}

// In place where it can be: this runs in every frame.
function fill(geometry, values) {
  const buffer = geometry.attributes.instanceStart?.data;
  if (buffer?.array.length === values.length) {
    buffer.array.set(values);
    buffer.needsUpdate = true;
  } else {
    geometry.setPositions(values.slice());
  }
}
