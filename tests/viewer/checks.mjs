// The HTML page by its controls. One line for each check: "ok NAME: figures" or "FAIL NAME: why".
//
//   ARBORCAM_NPM=DIR ARBORCAM_CHROMIUM=PROGRAM node checks.mjs FOLDER
//
// FOLDER holds page.html, page-m.html (the same tree in metres), page-one.html (one node), page-forest.html, tree.glb, outline.json,
// title.txt.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { Eye, launch, open, ready, shot, slide } from "./browser.mjs";

const file = (name) => join(process.argv[2], name);
const glb = readFileSync(file("tree.glb"));
const outline = JSON.parse(readFileSync(file("outline.json"), "utf8"));
const title = readFileSync(file("title.txt"), "utf8");
const { nodes, asset } = JSON.parse(glb.subarray(20, 20 + glb.readUInt32LE(12)).toString());
const leafy = nodes.some((n) => /^leaves/.test(n.name));

let failed = 0;
async function check(name, test) {
  try {
    console.log(`ok ${name}: ${(await test()) ?? ""}`);
  } catch (error) {
    failed++;
    console.log(`FAIL ${name}: ${error.message.split("\n").slice(0, 3).join(" / ")}`);
  }
}

function hold(truth, what) {
  if (!truth) throw new Error(what);
}

// Least overlap with the outline: of the drawn pixels themselves for a tree in leaf; of all that is within 3 % of the
// picture's height of the wood for a bare one, whose outline holds much sky (today 0.59 for the shipped clip).
const LEAST_OVERLAP = leafy ? 0.7 : 0.5;

const percent = (share) => `${(100 * share).toFixed(2)} %`;
const browser = await launch();
const eye = await Eye.open(browser);
const bad = [];

await check("shows the tree within 2 s", async () => {
  const times = [];
  for (let k = 0; k < 3; k++) {
    const page = await open(browser, file("page.html"), {}, bad);
    await ready(page);
    times.push(await page.evaluate(() => window.arborcam.ready));
    await page.context().close();
  }
  hold(Math.min(...times) <= 2000, `${times.map(Math.round)} ms`);
  return `${times.map(Math.round).join(", ")} ms from navigation to the first picture of the tree`;
});

const page = await open(browser, file("page.html"), {}, bad);
await ready(page);
const button = (name) => page.getByRole("button", { name, exact: true });
const differs = async (a, b, least, what) => {
  const share = await eye.differ(a, b);
  hold(share >= least, `${what}: only ${percent(share)} of the pixels differ`);
  return percent(share);
};
const look = (settle) => shot(page, settle);

await check("names the tree as it is called", async () => {
  hold((await page.locator("h1").textContent()) === title, await page.locator("h1").textContent());
  hold((await page.title()) === title, await page.title());
});

await check("play moves the tree, pause stops it", async () => {
  const [a, b] = [await look(100), await look(700)];
  const moved = await differs(a, b, 0.002, "playing");
  await button("Pause").click();
  const [c, d] = [await look(), await look(700)];
  hold(c.equals(d), "paused, the picture still changes");
  const clock = await page.locator("#clock").textContent();
  await button("Play").click();
  await page.waitForTimeout(500);
  await button("Pause").click();
  hold((await page.locator("#clock").textContent()) !== clock, "the clock stands still");
  return moved;
});

await check("the speed is that of the list", async () => {
  const seconds = async (speed) => {
    await page.getByLabel("Speed").selectOption({ label: speed });
    await page.getByLabel("Time", { exact: true }).press("Home");
    await button("Play").click();
    await page.waitForTimeout(1200);
    await button("Pause").click();
    return parseFloat(await page.locator("#clock").textContent());
  };
  const [slow, fast] = [await seconds("× 0.25"), await seconds("× 2")];
  await page.getByLabel("Speed").selectOption({ label: "× 1" });
  hold(fast > 4 * slow && slow > 0.1, `${slow} s and ${fast} s`);
  return `${slow} s at a quarter, ${fast} s at twice`;
});

await check("the scrub bar goes to a time", async () => {
  const bar = page.getByLabel("Time", { exact: true });
  await bar.press("Home");
  const begin = await look();
  await slide(bar, 0.1 * Number(await bar.getAttribute("max")));
  const later = await look();
  await bar.press("Home");
  hold((await look()).equals(begin), "the same time shows another picture");
  return differs(begin, later, 0.002, "at a tenth of the film");
});

await check("front, side and top differ", async () => {
  const views = {};
  for (const name of ["Side", "Top", "Front"]) {
    await button(name).click();
    views[name] = await look(900);
    hold((await button(name).getAttribute("aria-pressed")) === "true", `${name} is not shown as chosen`);
  }
  const [a, b] = [await differs(views.Front, views.Side, 0.02, "side"), await differs(views.Front, views.Top, 0.02, "top")];
  return `${a}, ${b}`;
});

await check("dragging turns it, the wheel zooms, Front leads back", async () => {
  const front = await look();
  const box = await page.locator("#canvas").boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 160, y - 60, { steps: 5 });
  await page.mouse.up();
  const turned = await look();
  await page.mouse.wheel(0, -400);
  const nearer = await look();
  await button("Front").click();
  hold((await eye.differ(front, await look(900))) < 1e-3, "Front is not where it was");
  return `${await differs(front, turned, 0.02, "turned")}, ${await differs(turned, nearer, 0.02, "zoomed")}`;
});

await check("skeleton, mesh, what is made up, and leaves are shown and hidden", async () => {
  const found = [];
  for (const name of ["Skeleton", "Mesh", "Made up", ...(leafy ? ["Leaves"] : [])]) {
    const before = await look(200);
    await button(name).click();
    found.push(`${name} ${await differs(before, await look(200), 0.003, name)}`);
    await button(name).click();
    hold((await look(200)).equals(before), `${name} twice does not lead back`);
  }
  hold((await button("Leaves").isDisabled()) === !leafy, "the button for leaves does not say whether there are any");
  return found.join(", ");
});

await check("each colouring is another", async () => {
  const list = page.getByLabel("Colour");
  const seen = {};
  for (const mode of ["natural", "branch", "frequency", "amplitude"]) {
    await list.selectOption(mode);
    seen[mode] = await look(300);
    const legend = await page.locator("#legend").isVisible();
    hold(legend === ["frequency", "amplitude"].includes(mode), `the legend of ${mode}`);
  }
  const modes = Object.keys(seen);
  for (const a of modes) for (const b of modes) if (a < b) await differs(seen[a], seen[b], 0.005, `${a} and ${b}`);
  const hues = await eye.hues(seen.branch);
  hold(hues >= 2, `only ${hues} hues for the branches`);
  await list.selectOption("natural");
  hold((await look(300)).equals(seen.natural), "as filmed is another colour afterwards");
  return `${hues} hues for the branches`;
});

const plots = async () => {
  const curve = (id) => page.locator(`${id} .curve`).getAttribute("d");
  return [await curve("#angle"), await curve("#spectrum")];
};

await check("a branch of the list shows its plots", async () => {
  hold(!(await page.locator("#angle").isVisible()), "there is a plot of no branch");
  const before = await look(200);
  const list = page.getByLabel("Branch", { exact: true });
  const values = await list.locator("optgroup").first().locator("option").evaluateAll((o) => o.map((x) => x.value));
  hold(values.length > 5, `${values.length} branches`);
  await list.selectOption(values[1]);
  const [angle, spectrum] = await plots();
  hold(angle.length > 1000 && spectrum.length > 500, "short curves");
  hold(!/NaN|undefined/.test(angle + spectrum), "no numbers in the curves");
  await differs(before, await look(200), 1e-4, "its mark in the tree");
  await button("Branch after").click();
  hold((await list.inputValue()) === values[2], "the next one is not the next of the list");
  hold((await plots())[0] !== angle, "another branch has the same plot");
  const facts = await page.locator("#facts").textContent();
  hold(/Frequency/.test(facts) && /Amplitude\d/.test(facts), facts);
  return `${values.length} measured branches; ${facts}`;
});

await check("the modes are those of the model, and a branch says with which it moves", async () => {
  const { modes } = asset.extras;
  await page.locator("#modes summary").click();
  const shown = await page.locator("#modes tbody tr").evaluateAll((rows) => rows.map((row) => row.textContent));
  hold(shown.length === modes.length && modes.length > 2, `${shown.length} rows of ${modes.length} modes`);
  for (const [k, mode] of modes.entries()) {
    hold(shown[k].startsWith(mode.frequency_hz.toFixed(2)) && shown[k].includes(mode.branch ?? "–"), shown[k]);
  }
  const mover = nodes.find((n) => n.extras?.participation).extras;
  await page.getByLabel("Branch", { exact: true }).selectOption(String(mover.node_id));
  const facts = await page.locator("#facts").textContent();
  hold(facts.includes(`(${mover.participation[0].frequency_hz.toFixed(2)} Hz)`), facts);
  await page.locator("#modes summary").click();
  return `${shown.length} modes; ${facts}`;
});

await check("a copy shows the plots of the branch that it repeats", async () => {
  const list = page.getByLabel("Branch", { exact: true });
  // A tree that was filmed bare has none.
  if (!leafy) {
    hold((await page.locator("#branch optgroup").count()) <= 1, "a bare tree has copies");
    hold(!/cop(y|ies)/.test(await page.locator("#about").textContent()), "the page counts copies");
    return "a bare tree has none";
  }
  const copy = page.locator("#branch optgroup").nth(1).locator("option").first();
  const [value, text] = [await copy.getAttribute("value"), await copy.textContent()];
  await list.selectOption(value);
  const of = await plots();
  await list.selectOption(/repeats (\d+)/.exec(text)[1]);
  hold((await plots()).every((d, k) => d === of[k]), text);
  return text;
});

await check("a tap on the tree chooses a branch, one beside it none", async () => {
  await page.getByLabel("Branch", { exact: true }).selectOption("");
  const box = await page.locator("#canvas").boundingBox();
  // The trunk's foot is in the front view of this tree in the middle third, low; it may be narrow.
  let chosen = "";
  for (let percent = 35; percent <= 65 && chosen === ""; percent++) {
    await page.mouse.click(box.x + (percent / 100) * box.width, box.y + 0.8 * box.height);
    chosen = await page.getByLabel("Branch", { exact: true }).inputValue();
  }
  hold(chosen !== "", "no branch is there");
  await page.mouse.click(box.x + 4, box.y + 4);
  hold((await page.getByLabel("Branch", { exact: true }).inputValue()) === "", "the corner chooses a branch");
  hold((await button("Front").getAttribute("aria-pressed")) === "true", "a tap has turned the tree");
  return `branch ${chosen}`;
});

await check("a press on the plot goes to that time", async () => {
  await page.getByLabel("Branch", { exact: true }).selectOption({ index: 2 });
  const box = await page.locator("#angle").boundingBox();
  await page.mouse.click(box.x + 0.5 * box.width, box.y + 0.5 * box.height);
  const [now, end] = (await page.locator("#clock").textContent()).match(/[\d.]+/g).map(Number);
  hold(Math.abs(now / end - 0.44) < 0.1, `${now} of ${end} s`);
  await page.getByLabel("Branch", { exact: true }).selectOption("");
  return `${now} s`;
});

await check("the keyboard does all of it", async () => {
  await page.locator("#canvas").focus();
  await page.keyboard.press("2");
  hold((await button("Side").getAttribute("aria-pressed")) === "true", "2 is not the side view");
  await page.keyboard.press("1");
  await page.keyboard.press(" ");
  hold(await button("Pause").isVisible(), "space does not play");
  await page.keyboard.press(" ");
  const before = await look(900);
  await page.keyboard.press("ArrowRight");
  await differs(before, await look(200), 0.01, "arrow");
  await page.keyboard.press("1");
  await page.keyboard.press(".");
  hold((await page.getByLabel("Branch", { exact: true }).inputValue()) !== "", ". chooses no branch");
  await page.keyboard.press("Escape");
  // Every control is reached by Tab.
  const reached = new Set();
  for (let k = 0; k < 30; k++) {
    await page.keyboard.press("Tab");
    reached.add(await page.evaluate(() => document.activeElement?.id || document.activeElement?.textContent));
  }
  for (const name of ["download", "colour", "canvas", "play", "scrub", "speed", "branch", "Side", "Film"]) {
    hold(reached.has(name) || (name === "Film" && !reached.has("Film") && (await button("Film").isDisabled())), `${name} is not reached`);
  }
  return `${reached.size} stops`;
});

await check("the film lies behind the front view, and the tree on it", async () => {
  const without = await look();
  await button("Film").click();
  const film = await look(900);
  const share = await differs(without, film, 0.3, "film");
  await button("Side").click();
  await page.waitForTimeout(900);
  hold(!(await page.locator("#caption").isVisible()), "from the side there is film");
  await button("Front").click();
  hold((await look(900)).equals(film), "back from the side the film looks different");
  await button("Film").click();
  const tree = await look(300);
  const { width, height } = await page.locator("#canvas").boundingBox();
  const zoom = Math.min(width / outline.width, height / outline.height);
  const size = [zoom * outline.width, zoom * outline.height];
  const box = [(width - size[0]) / 2, (height - size[1]) / 2, ...size];
  const radii = [0, 0.01, 0.02, 0.03].map((part) => part * outline.height);
  const found = await eye.overlap(tree, outline, box, radii);
  const told = found.map((x, k) => `${x.toFixed(2)} grown by ${radii[k].toFixed(1)} px`).join(", ");
  hold((leafy ? found[0] : found[3]) >= LEAST_OVERLAP, told);
  return `${share}; overlap with the outline ${told}`;
});

await check("the download is the model byte for byte", async () => {
  const [download] = await Promise.all([page.waitForEvent("download"), button("Download GLB").click()]);
  const got = readFileSync(await download.path());
  hold(got.equals(glb), `${got.length} bytes in place of ${glb.length}`);
  hold(/^[^/\\<>:"|?*]+\.glb$/.test(download.suggestedFilename()), download.suggestedFilename());
  return `${download.suggestedFilename()}, ${got.length} bytes`;
});

await check("a tree in metres looks like the one in pixels", async () => {
  const metres = await open(browser, file("page-m.html"), {}, bad);
  await ready(metres);
  await metres.getByRole("button", { name: "Pause" }).click();
  await metres.getByLabel("Time", { exact: true }).press("Home");
  await page.getByLabel("Time", { exact: true }).press("Home");
  await button("Front").click();
  const share = await eye.differ(await look(900), await shot(metres));
  await metres.context().close();
  hold(share < 0.01, `${percent(share)} of the pixels differ`);
  return percent(share);
});

await check("a phone has it all below one another, and fingers turn the tree", async () => {
  const options = { viewport: { width: 360, height: 740 }, deviceScaleFactor: 2, hasTouch: true, isMobile: true };
  const phone = await open(browser, file("page.html"), options, bad);
  await ready(phone);
  await phone.getByRole("button", { name: "Pause" }).tap();
  await phone.getByLabel("Branch", { exact: true }).selectOption({ index: 3 });
  const wide = await phone.evaluate(() => Math.max(document.documentElement.scrollWidth, document.body.scrollWidth));
  hold(wide <= 360, `${wide} px wide`);
  const small = await phone.evaluate(() =>
    [...document.querySelectorAll("button, select, #scrub")]
      .map((e) => [e.id || e.textContent, e.getBoundingClientRect()])
      .filter(([, r]) => r.height < 38 || r.left < 0 || r.right > 360.5)
      .map(([name]) => name),
  );
  hold(small.length === 0, `too small for a finger, or cut off: ${small}`);
  await phone.evaluate(() => window.scrollTo(0, 0));
  const before = await shot(phone);
  const box = await phone.locator("#canvas").boundingBox();
  const touch = await phone.context().newCDPSession(phone);
  const at = (x) => [{ x: box.x + x, y: box.y + box.height / 2 }];
  await touch.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: at(100) });
  for (const x of [120, 150, 180]) await touch.send("Input.dispatchTouchEvent", { type: "touchMove", touchPoints: at(x) });
  await touch.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
  const share = await differs(before, await shot(phone), 0.02, "a finger");
  await phone.context().close();
  return share;
});

await check("a tree of one node opens, without what it does not have", async () => {
  const one = await open(browser, file("page-one.html"), {}, bad);
  await ready(one);
  for (const name of ["Play", "Mesh", "Leaves", "Film"]) {
    hold(await one.getByRole("button", { name, exact: true }).isDisabled(), `${name} can be pressed`);
  }
  for (const name of ["Skeleton", "Side", "Top", "Branch after"]) await one.getByRole("button", { name, exact: true }).click();
  for (const mode of ["branch", "frequency", "amplitude"]) await one.getByLabel("Colour", { exact: true }).selectOption(mode);
  hold(!(await one.getByRole("alert").isVisible()), "it apologises");
  await one.context().close();
});

await check("a forest opens and sways, without what it does not have", async () => {
  const forest = await open(browser, file("page-forest.html"), {}, bad);
  await ready(forest);
  const about = await forest.locator("#about").textContent();
  hold(about.startsWith("5 trees of 2 from"), about);
  for (const name of ["Skeleton", "Film"]) {
    hold(await forest.getByRole("button", { name, exact: true }).isDisabled(), `${name} can be pressed`);
  }
  for (const id of ["#colour", "#branch", "#hint"]) hold(!(await forest.locator(id).isVisible()), `${id} is shown`);
  const [a, b] = [await shot(forest, 100), await shot(forest, 900)];
  const moved = await differs(a, b, 0.002, "playing");
  await forest.getByRole("button", { name: "Mesh", exact: true }).click();
  await differs(b, await shot(forest), 0.01, "without the trees");
  for (const name of ["Front", "Side", "Top"]) await forest.getByRole("button", { name, exact: true }).click();
  hold(!(await forest.getByRole("alert").isVisible()), "it apologises");
  await forest.context().close();
  return moved;
});

await check("nothing is asked of the network and nothing complains", async () => {
  hold(bad.length === 0, [...new Set(bad)].join("; "));
});

await check("without 3D it says so, and gives the model all the same", async () => {
  const flat = await launch(["--disable-3d-apis"]);
  try {
    const page = await open(flat, file("page.html"));
    await page.getByRole("alert").waitFor();
    const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: "Download GLB" }).click()]);
    hold(readFileSync(await download.path()).equals(glb), "another model");
    return await page.getByRole("alert").textContent();
  } finally {
    await flat.close();
  }
});

await browser.close();
process.exit(failed ? 1 : 0);
