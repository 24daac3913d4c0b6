// Which branch is chosen: from the list, by the arrows beside it, or by a tap on the tree.
import * as THREE from "three";

// A finger is this broad, CSS px.
const REACH = 22;

export class Choice {
  // `changed(branch or null)` is called for every new choice.
  constructor(tree, data, changed) {
    Object.assign(this, { tree, data, changed, branch: null });
    this.list = document.getElementById("branch");
    this.list.append(new Option("none", ""), ...groups(data));
    this.list.addEventListener("change", () => this.set(this.list.value === "" ? null : Number(this.list.value)));
    document.getElementById("before").addEventListener("click", () => this.step(-1));
    document.getElementById("after").addEventListener("click", () => this.step(1));
  }

  set(id) {
    this.branch = this.data.byId.get(id) ?? null;
    this.list.value = this.branch ? String(this.branch.id) : "";
    this.changed(this.branch);
  }

  step(by) {
    const n = this.list.options.length;
    const next = (this.list.selectedIndex + by + n) % n;
    const value = this.list.options[next].value;
    this.set(value === "" ? null : Number(value));
  }

  // A tap is a press that did not move: what moved has turned the tree.
  onTap(canvas, camera) {
    let down = null;
    canvas.addEventListener("pointerdown", (e) => (down = e.isPrimary ? [e.clientX, e.clientY] : null));
    canvas.addEventListener("pointerup", (e) => {
      if (!down || Math.hypot(e.clientX - down[0], e.clientY - down[1]) > 6) return;
      const box = canvas.getBoundingClientRect();
      const found = this.nearest(e.clientX - box.left, e.clientY - box.top, box, camera);
      // A bend belongs to the branch that it moves with.
      this.set(found ? (found.moves_with ?? found.id) : null);
    });
  }

  // The branch whose line is nearest to a place on the canvas, the nearer to the eye where two are alike.
  nearest(x, y, { width, height }, camera) {
    const [a, b] = [new THREE.Vector3(), new THREE.Vector3()];
    let [best, least] = [null, REACH];
    for (const branch of this.tree.branches) {
      this.tree.segment(branch, a, b);
      for (const p of [a, b]) {
        p.project(camera);
        p.set(((p.x + 1) / 2) * width, ((1 - p.y) / 2) * height, p.z);
      }
      const length = (b.x - a.x) ** 2 + (b.y - a.y) ** 2;
      const along = length > 0 ? ((x - a.x) * (b.x - a.x) + (y - a.y) * (b.y - a.y)) / length : 0;
      const t = Math.min(1, Math.max(0, along));
      const distance = Math.hypot(x - a.x - t * (b.x - a.x), y - a.y - t * (b.y - a.y)) + 3 * (a.z + t * (b.z - a.z));
      if (distance < least) [best, least] = [branch, distance];
    }
    return best;
  }
}

function groups(data) {
  const group = (label, branches) => {
    const element = document.createElement("optgroup");
    element.label = label;
    element.append(...branches.map((b) => new Option(name(b), b.id)));
    return element;
  };
  const all = data.branches.filter((b) => b.parent !== null && b.moves_with === null);
  const [measured, copies] = [all.filter((b) => b.copy_of === null), all.filter((b) => b.copy_of !== null)];
  return [group("Measured", measured), ...(copies.length ? [group("Copies", copies)] : [])];
}

function name(branch) {
  if (branch.copy_of !== null) return `${branch.name} · repeats ${branch.copy_of}`;
  return `${branch.name} · node ${branch.id}`;
}
