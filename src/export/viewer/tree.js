// The model: its joints, wood and leaves, and its motion. Seen from outside it is in px, whatever the file's unit.
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

export class Tree {
  static async load(bytes, data) {
    const gltf = await new GLTFLoader().parseAsync(bytes.buffer, "");
    return new Tree(gltf, data);
  }

  constructor(gltf, data) {
    const unitsPerPx = data.metres_per_px > 0 ? data.metres_per_px : 1;
    this.root = new THREE.Group();
    this.root.scale.setScalar(1 / unitsPerPx);
    this.root.add(gltf.scene);
    this.joints = new Map();
    this.wood = [];
    // Of the wood, what nobody has seen: twigs, copies, grown branches.
    this.madeUp = [];
    this.leaves = [];
    this.ground = [];
    gltf.scene.traverse((object) => {
      const id = jointId(object);
      if (id !== null) this.joints.set(id, object);
      if (!object.isMesh) return;
      // The box at rest is not where the tree is in the wind.
      object.frustumCulled = false;
      const kinds = { leaf: this.leaves, ground: this.ground };
      (kinds[object.material.name] ?? this.wood).push(object);
      if (object.material.name === "bark_made_up") this.madeUp.push(object);
    });
    this.branches = [];
    for (const branch of data.branches) {
      const joint = this.joints.get(branch.id);
      const parent = data.byId.get(branch.parent);
      if (!joint || !parent) continue;
      // A joint lies at its parent node and is not turned at rest; the branch's end hangs on it.
      const way = new THREE.Vector3(...branch.end).sub(new THREE.Vector3(...parent.end)).multiplyScalar(unitsPerPx);
      this.branches.push({ ...branch, joint, way });
    }
    const clip = gltf.animations[0];
    this.duration = clip ? clip.duration : 0;
    if (clip) {
      this.mixer = new THREE.AnimationMixer(gltf.scene);
      this.mixer.clipAction(clip).play();
    }
    this.time = 0;
    this.show(0);
  }

  show(time) {
    this.time = time;
    // At its very end the animation would begin again.
    this.mixer?.setTime(Math.min(time, this.duration - 1e-4));
    this.root.updateMatrixWorld(true);
  }

  // From where to where a branch runs now, px.
  segment(branch, from, to) {
    from.setFromMatrixPosition(branch.joint.matrixWorld);
    to.copy(branch.way).applyMatrix4(branch.joint.matrixWorld);
  }

  // Everything there is at rest, px.
  box() {
    const box = new THREE.Box3();
    const [a, b] = [new THREE.Vector3(), new THREE.Vector3()];
    for (const branch of this.branches) {
      this.segment(branch, a, b);
      box.expandByPoint(a).expandByPoint(b);
    }
    for (const mesh of [...this.wood, ...this.leaves]) {
      mesh.geometry.computeBoundingBox();
      const { min, max } = mesh.geometry.boundingBox;
      for (const corner of [min, max]) box.expandByPoint(corner.clone().multiplyScalar(this.root.scale.x));
    }
    return box.isEmpty() ? box.set(new THREE.Vector3(-1, 0, -1), new THREE.Vector3(1, 2, 1)) : box;
  }
}

// The node of the table that a joint is; null for what is no joint. The loader changes names that have dots in them.
export function jointId(object) {
  return object.userData.node_id ?? null;
}
