// A forest: trees without joints, whose meshes are displaced.
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Tree } from "./tree.js";

export class Forest extends Tree {
  static async load(bytes, data) {
    return new Forest(await new GLTFLoader().parseAsync(bytes.buffer, ""), data);
  }

  // Everything there is at rest, m.
  box() {
    const box = new THREE.Box3();
    for (const mesh of [...this.wood, ...this.leaves, ...this.ground]) {
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      box.union(mesh.geometry.boundingBox.clone().applyMatrix4(mesh.matrixWorld));
    }
    return box;
  }
}
