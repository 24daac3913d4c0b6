// Puts the page together: what it carries, the tree, and its controls.
import { Choice } from "./choice.js";
import { readData, readModel, readPicture } from "./data.js";
import { Film, rectangle } from "./film.js";
import { Forest } from "./forest.js";
import { listen } from "./keys.js";
import { fillModes } from "./modes.js";
import { Paint } from "./paint.js";
import { Panel } from "./panel.js";
import { Player } from "./player.js";
import { Skeleton } from "./skeleton.js";
import { ground, Stage } from "./stage.js";
import { Sway } from "./sway.js";
import { Tree } from "./tree.js";
import { Views } from "./views.js";

const at = (id) => document.getElementById(id);
const pressed = (button) => button.getAttribute("aria-pressed") === "true";
const press = (button, on) => button.setAttribute("aria-pressed", String(on));

function sorry(text) {
  at("sorry").textContent = text;
  at("sorry").hidden = false;
}

function describe(data) {
  at("title").textContent = document.title = data.title;
  if (data.forest) {
    const { trees, templates } = data.forest;
    at("about").textContent = `${trees} ${trees === 1 ? "tree" : "trees"} of ${templates} from ${data.source}`;
    at("made").textContent = `${data.software}.`;
    document.body.classList.add("forest");
    return;
  }
  const measured = data.branches.filter((b) => b.parent !== null && b.moves_with === null && b.copy_of === null).length;
  const copies = data.branches.filter((b) => b.copy_of !== null).length;
  const parts = [
    `${measured} ${measured === 1 ? "branch" : "branches"}${copies ? `, ${copies} copies` : ""}`,
    data.source,
    data.captured_at,
    ...Object.entries(data.notes).map(([key, value]) => `${key}: ${value}`),
  ];
  at("about").textContent = parts.filter(Boolean).join(" · ");
  at("made").textContent = `${data.software}, from ${data.image[0]} × ${data.image[1]} pixels.`;
}

function offerDownload(bytes, title) {
  at("download").addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([bytes], { type: "model/gltf-binary" }));
    link.download = `${title.replace(/[^\p{L}\p{N}._-]+/gu, "_").replace(/^[._]+/, "") || "tree"}.glb`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  });
}

function partButtons(stage, tree, skeleton, film, { views, look, atFilm }) {
  const shown = { mesh: true, madeUp: true };
  const showWood = () => {
    for (const mesh of tree.wood) mesh.visible = shown.mesh && (shown.madeUp || !tree.madeUp.includes(mesh));
  };
  const show = {
    skeleton: (on) => skeleton.show(on),
    mesh: (on) => (shown.mesh = on),
    made_up: (on) => (shown.madeUp = on),
    leaves: (on) => tree.leaves.forEach((m) => (m.visible = on)),
    film: (on) => {
      film.on = on;
      views.setFrame(on ? film.rectangle : null);
      // It is seen from the front, as a whole, and with the tree as it stood in that frame.
      if (on) views.show("front");
      if (on) atFilm();
      look();
    },
  };
  const there = {
    skeleton: !(tree instanceof Forest),
    mesh: tree.wood.length > 0,
    made_up: tree.madeUp.length > 0,
    leaves: tree.leaves.length > 0,
    film: film !== null,
  };
  const why = {
    skeleton: "A forest has no skeleton here",
    mesh: "This model has no mesh",
    made_up: tree instanceof Forest ? "A forest does not say what was seen" : "Either all of this wood was seen, or none",
    leaves: "This model has no leaves",
    film: "This capture has no picture",
  };
  return Object.fromEntries(
    [...document.querySelectorAll("[data-part]")].map((button) => {
      const part = button.dataset.part;
      const toggle = () => {
        if (button.disabled) return;
        press(button, !pressed(button));
        show[part](pressed(button));
        showWood();
        stage.ask();
      };
      if (!there[part]) {
        button.disabled = true;
        button.title = why[part];
        press(button, false);
      }
      button.addEventListener("click", toggle);
      return [part, toggle];
    }),
  );
}

function viewButtons(views) {
  const buttons = [...document.querySelectorAll("[data-view]")];
  for (const button of buttons) button.addEventListener("click", () => views.show(button.dataset.view));
  views.onChange.push(() => buttons.forEach((b) => press(b, b.dataset.view === views.name)));
}

async function open() {
  const data = readData();
  describe(data);
  fillModes(at("modes"), data.modes);
  const model = await readModel();
  offerDownload(model, data.title);
  let stage;
  try {
    stage = new Stage(at("canvas"));
  } catch {
    sorry("This browser cannot draw in 3D (WebGL 2 is off or missing). Another browser can; the model can be downloaded above.");
    return;
  }
  const [tree, picture] = await Promise.all([(data.forest ? Forest : Tree).load(model, data), readPicture()]);
  const box = tree.box();
  const views = new Views(stage, box);
  const sway = new Sway(data);
  const skeleton = new Skeleton(tree);
  const film = picture && new Film(data, picture, box.min.z - views.radius);
  const filmTime = data.picture_time_s ?? 0;
  const look = () => {
    film?.look(views.awayFromFront());
    at("caption").hidden = !film?.object.visible;
  };
  const rings = ground(Math.max(-box.min.x, box.max.x, -box.min.z, box.max.z));
  stage.scene.add(tree.root, skeleton.object, rings);
  if (film) {
    film.rectangle = rectangle(data);
    stage.scene.add(film.object);
    at("caption").textContent = `Film at ${filmTime.toFixed(2)} s, outline in white`;
    views.onChange.push(look);
  }
  stage.beforeDraw.push(() => {
    skeleton.update();
    rings.visible = !film?.object.visible && !data.forest;
  });

  const paint = new Paint(tree, data, sway, skeleton, at("legend"));
  const colour = at("colour");
  const recolour = () => {
    paint.set(colour.value);
    stage.ask();
  };
  colour.addEventListener("change", recolour);
  viewButtons(views);

  let panel = null;
  const player = new Player(tree, data, (time) => {
    tree.show(time);
    panel?.at(time);
    stage.ask();
  });
  panel = new Panel(data, sway, (time) => {
    player.toggle(false);
    player.seek(time);
  });
  const choice = new Choice(tree, data, (branch) => {
    skeleton.choose(branch?.id);
    panel.show(branch);
    stage.ask();
  });
  const atFilm = () => {
    player.toggle(false);
    player.seek(filmTime - data.start_s);
  };
  const parts = partButtons(stage, tree, skeleton, film, { views, look, atFilm });
  choice.onTap(stage.canvas, stage.camera);
  listen(
    {
      " ": () => player.toggle(), "[": () => player.step(-1), "]": () => player.step(1),
      1: () => views.show("front"), 2: () => views.show("side"), 3: () => views.show("top"),
      s: parts.skeleton, m: parts.mesh, u: parts.made_up, l: parts.leaves, f: parts.film,
      c: () => {
        colour.selectedIndex = (colour.selectedIndex + 1) % colour.options.length;
        recolour();
      },
      ",": () => choice.step(-1), ".": () => choice.step(1), escape: () => choice.set(null),
    },
    stage.canvas,
    views,
  );
  recolour();
  views.show("front", false);
  // From the front the first row hides the others.
  if (data.forest) views.turn(0.5, 0.4, 0.75);
  stage.draw();
  // Browsers may restore a form's last state over the page's first one.
  performance.mark("arborcam-ready");
  window.arborcam = { ready: performance.now() };
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) player.toggle(true);
}

open().catch((error) => {
  console.error(error);
  sorry("The tree in this page cannot be shown: the file is damaged, or the browser too old. Export it again, or update the browser.");
});
