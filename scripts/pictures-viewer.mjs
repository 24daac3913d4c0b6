// Pictures of an exported page for the documents: a desktop's and a phone's screen.
//
//   scripts/test-modules.sh
//   node scripts/pictures-viewer.mjs PAGE.html docs/pictures/viewer.png docs/pictures/viewer-phone.png
//
// Chromium is the one in PATH, or that of ARBORCAM_CHROMIUM.
import { existsSync } from "node:fs";
import { delimiter, join, resolve } from "node:path";

const target = resolve(process.env.CARGO_TARGET_DIR ?? "target");
process.env.ARBORCAM_NPM ??= join(target, "test-npm");
process.env.ARBORCAM_CHROMIUM ??= (process.env.PATH ?? "")
  .split(delimiter)
  .flatMap((folder) => ["chromium", "chromium-browser", "google-chrome"].map((name) => join(folder, name)))
  .find((file) => existsSync(file));
const [file, desktop, phone] = process.argv.slice(2);
if (!phone) {
  console.error("usage: node pictures-viewer.mjs PAGE.html DESKTOP.png PHONE.png");
  process.exit(2);
}
const { launch, open, ready, slide } = await import("../tests/viewer/browser.mjs");
const browser = await launch();

async function picture(options, out, then) {
  const page = await open(browser, resolve(file), options);
  await ready(page);
  await page.getByRole("button", { name: "Pause" }).click();
  await then(page);
  // The keys' help stays folded, no control is under the mouse.
  await page.mouse.move(2, 2);
  await page.waitForTimeout(900);
  await page.screenshot({ path: out });
  await page.context().close();
}

const list = (page, name) => page.getByLabel(name, { exact: true });
await picture({ viewport: { width: 1280, height: 760 } }, desktop, async (page) => {
  await list(page, "Branch").selectOption({ index: 4 });
  await list(page, "Colour").selectOption("branch");
  await slide(list(page, "Time"), 1.5);
  const { x, y, width, height } = await page.locator("#canvas").boundingBox();
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  await page.mouse.move(x + width / 2 - 60, y + height / 2 + 30, { steps: 4 });
  await page.mouse.up();
});
const small = { viewport: { width: 360, height: 740 }, deviceScaleFactor: 1.5, hasTouch: true, isMobile: true };
await picture(small, phone, async (page) => {
  await list(page, "Colour").selectOption("frequency");
  await slide(list(page, "Time"), 1.5);
});
await browser.close();
