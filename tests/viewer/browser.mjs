// A browser with the page in it, and what its pictures show. Used by checks.mjs.
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";
import { join } from "node:path";

const modules = process.env.ARBORCAM_NPM;
const { chromium } = createRequire(join(modules, "package.json"))("playwright-core");

// WebGL in software: no test machine has the same graphics as another.
const DRAW = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

export const launch = (args = DRAW) =>
  chromium.launch({ executablePath: process.env.ARBORCAM_CHROMIUM, args: ["--no-sandbox", ...args] });

// A tab without a network, and everything that it should not do: `bad` stays empty.
export async function open(browser, file, options = {}, bad = []) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, acceptDownloads: true, ...options });
  await context.setOffline(true);
  const page = await context.newPage();
  page.setDefaultTimeout(15_000);
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && !driver(m.text()) && bad.push(`console: ${m.text()}`));
  page.on("pageerror", (e) => bad.push(`error: ${e.message}`));
  page.on("request", (r) => /^(file|blob|data):/.test(r.url()) || bad.push(`request: ${r.url()}`));
  await page.goto(pathToFileURL(file).href);
  return page;
}

// Chromium's own remark on reading pixels back from software graphics, of which the screenshots are made.
const driver = (text) => /GPU stall due to ReadPixels/.test(text);

// Asked again and again: the page's own policy forbids what Playwright's waiting for a function does.
export async function ready(page) {
  for (const end = Date.now() + 15_000; Date.now() < end; await page.waitForTimeout(20)) {
    const found = await page.evaluate(() => window.arborcam?.ready);
    if (found) return found;
  }
  throw new Error("the page does not say that it is ready");
}

// A slider goes to a value; older Playwright cannot fill one with many digits.
export const slide = (slider, value) =>
  slider.evaluate((input, value) => {
    input.value = value;
    input.dispatchEvent(new Event("input", { bubbles: true }));
    input.dispatchEvent(new Event("change", { bubbles: true }));
  }, String(value));

// The canvas alone. Glides between views take a third of a second.
export async function shot(page, settle = 600) {
  await page.waitForTimeout(settle);
  return page.locator("#canvas").screenshot();
}

// Compares pictures in a tab of its own, where the browser decodes them.
export class Eye {
  static async open(browser) {
    const page = await browser.newPage();
    await page.evaluate(() => {
      window.pixels = async (png, width, height, box) => {
        const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
        const [w, h] = [width ?? image.width, height ?? image.height];
        const context = new OffscreenCanvas(w, h).getContext("2d");
        const [x, y, bw, bh] = box ?? [0, 0, image.width, image.height];
        context.drawImage(image, x, y, bw, bh, 0, 0, w, h);
        return { w, h, data: context.getImageData(0, 0, w, h).data };
      };
    });
    return new Eye(page);
  }

  constructor(page) {
    this.page = page;
  }

  // Share of the pixels that differ visibly.
  differ(a, b) {
    return this.page.evaluate(
      async ([a, b]) => {
        const [p, q] = [await pixels(a), await pixels(b)];
        if (p.w !== q.w || p.h !== q.h) return 1;
        let n = 0;
        for (let i = 0; i < p.data.length; i += 4) {
          const d = [0, 1, 2].reduce((s, c) => s + Math.abs(p.data[i + c] - q.data[i + c]), 0);
          if (d > 40) n++;
        }
        return n / (p.w * p.h);
      },
      [a.toString("base64"), b.toString("base64")],
    );
  }

  // How many hues, of 12, have at least a thousandth of the picture, among strong colours.
  hues(a) {
    return this.page.evaluate(async (a) => {
      const p = await pixels(a);
      const count = new Array(12).fill(0);
      for (let i = 0; i < p.data.length; i += 4) {
        const [r, g, b] = [0, 1, 2].map((c) => p.data[i + c]);
        const [high, low] = [Math.max(r, g, b), Math.min(r, g, b)];
        if (high - low < 60) continue;
        const hue = high === r ? (g - b) / (high - low) : high === g ? 2 + (b - r) / (high - low) : 4 + (r - g) / (high - low);
        count[Math.floor((2 * hue + 12.5) % 12)]++;
      }
      return count.filter((n) => n > 1e-3 * p.w * p.h).length;
    }, a.toString("base64"));
  }

  // Intersection over union of what is drawn in front of the paper and the outline's polygon, in the film's pixels, with
  // what is drawn grown by each of `radii` px. `box`: where the film's rectangle lies in the picture.
  overlap(a, { width, height, polygon_px }, box, radii) {
    return this.page.evaluate(
      async ([a, width, height, polygon, box, radii]) => {
        const p = await pixels(a, width, height, box);
        const paper = p.data.slice(0, 3);
        const drawn = new Float32Array(width * height).fill(1e9);
        for (let i = 0; i < drawn.length; i++) {
          // Paler than this are the rings on the ground.
          const d = [0, 1, 2].reduce((s, c) => s + Math.abs(p.data[4 * i + c] - paper[c]), 0);
          if (d > 130) drawn[i] = 0;
        }
        // Distance to what is drawn, in two passes (chamfer).
        const relax = (i, j, d) => (drawn[i] = Math.min(drawn[i], drawn[j] + d));
        for (const [from, to, by] of [[0, drawn.length, 1], [drawn.length - 1, -1, -1]]) {
          for (let i = from; i !== to; i += by) {
            const [x, y] = [i % width, Math.floor(i / width)];
            const before = by > 0 ? x > 0 : x < width - 1;
            const above = by > 0 ? y > 0 : y < height - 1;
            if (before) relax(i, i - by, 1);
            if (above) relax(i, i - by * width, 1);
            if (above && before) relax(i, i - by * width - by, Math.SQRT2);
            if (above && (by > 0 ? x < width - 1 : x > 0)) relax(i, i - by * width + by, Math.SQRT2);
          }
        }
        const context = new OffscreenCanvas(width, height).getContext("2d");
        context.beginPath();
        // The centre of the first pixel is (0, 0) in the outline, (0.5, 0.5) here.
        polygon.forEach(([u, v]) => context.lineTo(u + 0.5, v + 0.5));
        context.closePath();
        context.fill();
        const outline = context.getImageData(0, 0, width, height).data;
        return radii.map((r) => {
          let [both, any] = [0, 0];
          for (let i = 0; i < drawn.length; i++) {
            const [tree, inside] = [drawn[i] <= r, outline[4 * i + 3] > 127];
            both += tree && inside;
            any += tree || inside;
          }
          return both / any;
        });
      },
      [a.toString("base64"), width, height, polygon_px, box, radii],
    );
  }
}
