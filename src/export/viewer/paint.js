// Colour of wood, leaves and skeleton: as filmed, by branch, or by a number on a scale.
import * as THREE from "three";
import { jointId } from "./tree.js";

// Even steps of lightness, no yellow: it is read on white and in sunlight (after "plasma").
const RAMP = ["#2f2fc4", "#7423c6", "#ae2aa6", "#d7456f", "#ee7545", "#f2a32e"];
const UNKNOWN = new THREE.Color("#9aa19c");
// The measured skeleton, and its copies, of which nothing was seen.
const MEASURED = new THREE.Color("#14532d");
const COPIED = new THREE.Color("#8fae9c");

function onRamp(share) {
  const x = Math.min(1, Math.max(0, share)) * (RAMP.length - 1);
  const k = Math.min(RAMP.length - 2, Math.floor(x));
  return new THREE.Color(RAMP[k]).lerp(new THREE.Color(RAMP[k + 1]), x - k);
}

const NUMBERS = {
  // A peak of the spectrum is no frequency of the branch: only what was identified has a colour.
  frequency: { title: "Frequency", unit: "Hz", without: "not identified", of: (sway) => (sway.identified ? sway.hz : null) },
  amplitude: { title: "Amplitude", unit: "°", without: "none found", of: (sway) => sway.amplitude },
};

export class Paint {
  constructor(tree, data, sway, skeleton, legend) {
    Object.assign(this, { tree, data, sway, skeleton, legend });
    this.filmed = new Map([...tree.wood, ...tree.leaves].map((mesh) => [mesh, natural(mesh)]));
  }

  set(mode) {
    const colourOf = this.scheme(mode);
    this.skeleton.paint((branch) => colourOf(branch));
    for (const [mesh, as] of this.filmed) {
      if (mode === "natural") {
        mesh.material = as.material;
        put(mesh, as.colour);
      } else {
        as.plain ??= plain(as.material);
        mesh.material = as.plain;
        put(mesh, new THREE.BufferAttribute(this.ofVertices(mesh, colourOf), 3));
      }
    }
  }

  // A function from branch to colour; shows the legend that goes with it.
  scheme(mode) {
    const number = NUMBERS[mode];
    this.legend.hidden = !number;
    if (mode === "branch") return byBranch(this.data);
    if (!number) return (branch) => (branch.copy_of === null ? MEASURED : COPIED);
    const values = this.data.branches.filter((b) => b.parent !== null).map((b) => number.of(this.sway.of(b)));
    const known = values.filter((x) => x !== null);
    const [low, high] = [Math.min(...known), Math.max(...known)];
    this.describe(number, known.length ? [low, high] : null, known.length < values.length);
    return (branch) => {
      const x = number.of(this.sway.of(branch));
      return x === null ? UNKNOWN : onRamp(high > low ? (x - low) / (high - low) : 0.5);
    };
  }

  describe({ title, unit, without }, range, someUnknown) {
    const say = (tag, className, text = "") => {
      const element = document.createElement(tag);
      element.className = className;
      element.textContent = text;
      return element;
    };
    this.legend.replaceChildren(say("strong", "", title));
    if (range) {
      const ramp = say("div", "ramp");
      ramp.style.background = `linear-gradient(90deg, ${RAMP.join(",")})`;
      const ends = say("div", "ends");
      const middle = (range[0] + range[1]) / 2;
      ends.append(...[range[0], middle, range[1]].map((x) => say("span", "", `${x.toFixed(2)} ${unit}`)));
      this.legend.append(ramp, ends);
    }
    if (someUnknown) {
      const line = say("div", "");
      const box = say("span", "none");
      box.style.background = `#${UNKNOWN.getHexString()}`;
      line.append(box, without);
      this.legend.append(line);
    }
  }

  // Every vertex has the mixture of the colours of the joints that move it.
  ofVertices(mesh, colourOf) {
    const { skinIndex, skinWeight, position } = mesh.geometry.attributes;
    const out = new Float32Array(3 * position.count);
    const bones = mesh.skeleton?.bones ?? [];
    const colours = bones.map((bone) => {
      const branch = this.data.byId.get(jointId(bone));
      // The foot is no branch: what hangs on it belongs to the trunk.
      const own = branch?.parent === null ? this.data.branches.find((b) => b.parent === branch.id) : branch;
      return own ? colourOf(own) : UNKNOWN;
    });
    for (let v = 0; v < position.count; v++) {
      let [r, g, b, sum] = [0, 0, 0, 0];
      for (let k = 0; skinIndex && k < 4; k++) {
        const weight = skinWeight.getComponent(v, k);
        const colour = weight > 0 ? colours[skinIndex.getComponent(v, k)] : null;
        if (!colour) continue;
        r += weight * colour.r;
        g += weight * colour.g;
        b += weight * colour.b;
        sum += weight;
      }
      if (sum > 0) out.set([r / sum, g / sum, b / sum], 3 * v);
      else UNKNOWN.toArray(out, 3 * v);
    }
    return out;
  }
}

function natural(mesh) {
  return { material: mesh.material, colour: mesh.geometry.attributes.color ?? null, plain: null };
}

function put(mesh, colour) {
  if (colour) mesh.geometry.setAttribute("color", colour);
  else mesh.geometry.deleteAttribute("color");
}

// The same shape without the film's colours: of a texture, only what it cuts away stays.
function plain(material) {
  const { side, map, alphaTest, transparent } = material;
  const out = new THREE.MeshLambertMaterial({ vertexColors: true, side, map, alphaTest, transparent });
  out.onBeforeCompile = (shader) => {
    shader.fragmentShader = shader.fragmentShader.replace(
      "#include <map_fragment>",
      "#ifdef USE_MAP\n diffuseColor.a *= texture2D(map, vMapUv).a;\n#endif",
    );
  };
  return out;
}

// Each main branch a hue of its own, the branches on it lighter and darker shades of it; a copy as its original.
function byBranch(data) {
  const hues = data.main_branch_rgb.map((rgb) => new THREE.Color(`rgb(${rgb})`).getHSL({}, THREE.SRGBColorSpace));
  const trunk = new THREE.Color("#5b4a3a");
  const counts = new Map();
  const colours = new Map();
  for (const b of data.branches) {
    if (b.copy_of !== null || b.moves_with !== null || b.main_branch === null) continue;
    const i = counts.get(b.main_branch) ?? 0;
    counts.set(b.main_branch, i + 1);
    const { h, s, l } = hues[b.main_branch % hues.length];
    const shade = l * (0.75 + 0.08 * ((i * 3) % 5));
    colours.set(b.id, new THREE.Color().setHSL(h, s, shade, THREE.SRGBColorSpace));
  }
  return (branch) => colours.get(data.byId.get(branch.id)?.original.id) ?? trunk;
}
