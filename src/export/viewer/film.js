// The source frame behind the front view, pixel on pixel: the model's unit is the pixel, its origin the trunk's foot.
import * as THREE from "three";

// Seen from the front up to the first angle, gone from the second on, radians.
const SEEN = 0.02;
const GONE = 0.2;

// Where the picture lies in the front plane. The centre of the top-left pixel is (0, 0).
export function rectangle(data) {
  const [width, height] = data.image;
  const [u, v] = data.foot_px;
  return { left: -0.5 - u, right: width - 0.5 - u, top: v + 0.5, bottom: v + 0.5 - height };
}

export class Film {
  // `depth`: where along z, behind everything; from the front that makes no difference.
  constructor(data, image, depth) {
    const { left, right, top, bottom } = rectangle(data);
    const texture = new THREE.Texture(image);
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.needsUpdate = true;
    const flat = { transparent: true, depthWrite: false, toneMapped: false };
    this.picture = new THREE.Mesh(
      new THREE.PlaneGeometry(right - left, top - bottom),
      new THREE.MeshBasicMaterial({ map: texture, ...flat }),
    );
    this.picture.position.set((left + right) / 2, (top + bottom) / 2, depth);
    this.picture.renderOrder = -2;
    const [u, v] = data.foot_px;
    const corners = (data.outline_px ?? []).map(([x, y]) => new THREE.Vector3(x - u, v - y, depth));
    this.outline = new THREE.LineLoop(
      new THREE.BufferGeometry().setFromPoints(corners),
      new THREE.LineBasicMaterial({ color: 0xffffff, ...flat }),
    );
    this.outline.renderOrder = -1;
    this.object = new THREE.Group().add(this.picture, this.outline);
    this.object.visible = this.on = false;
  }

  // `away`: angle between the eye and the front view, radians.
  look(away) {
    const opacity = Math.min(1, Math.max(0, (GONE - away) / (GONE - SEEN)));
    this.object.visible = this.on && opacity > 0;
    this.picture.material.opacity = opacity;
    this.outline.material.opacity = 0.75 * opacity;
  }
}
