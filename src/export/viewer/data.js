// What the page carries: the tree's data, its model, and the source frame.
const text = (id) => document.getElementById(id).textContent.trim();

function bytesOf(base64) {
  const packed = atob(base64);
  const bytes = new Uint8Array(packed.length);
  for (let i = 0; i < packed.length; i++) bytes[i] = packed.charCodeAt(i);
  return bytes;
}

// Hundredths of a degree as little-endian 16-bit numbers; the lowest one stands for "not known".
function anglesOf(base64) {
  const bytes = bytesOf(base64);
  const view = new DataView(bytes.buffer);
  const angles = new Float64Array(bytes.length >> 1);
  for (let k = 0; k < angles.length; k++) {
    const hundredths = view.getInt16(2 * k, true);
    angles[k] = hundredths === -32768 ? NaN : hundredths / 100;
  }
  return angles;
}

// {title, source, image, foot_px, branches, …} as written by src/export/html_data.rs, with
// `byId` added, and in each branch `angle_deg` as numbers and `original`, the branch that was measured: of a copy the
// one that it repeats, of what moves with another one that one.
export function readData() {
  const data = JSON.parse(text("arborcam-data"));
  data.byId = new Map(data.branches.map((b) => [b.id, b]));
  for (const b of data.branches) b.angle_deg = b.angle_deg ? anglesOf(b.angle_deg) : null;
  for (const b of data.branches) {
    const seen = data.byId.get(b.copy_of) ?? b;
    b.original = data.byId.get(seen.moves_with) ?? seen;
  }
  return data;
}

// The bytes of the GLB file, as they were exported.
export async function readModel() {
  const packed = new Blob([bytesOf(text("arborcam-glb"))]).stream();
  return new Uint8Array(await new Response(packed.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer());
}

// The source frame as an image, or null where there is none that can be shown.
export async function readPicture() {
  const base64 = text("arborcam-picture");
  if (!base64) return null;
  const image = new Image();
  image.src = `data:image/jpeg;base64,${base64}`;
  return image.decode().then(() => image, () => null);
}
