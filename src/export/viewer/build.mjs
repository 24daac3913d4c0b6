// node build.mjs OUT.html: one page with all code and style in it, and the places for the data left open.
// Run by scripts/build-viewer.sh, in a copy of this folder that has the packages beside it.
import { readFileSync, writeFileSync } from "node:fs";
import * as esbuild from "esbuild";

const here = new URL(".", import.meta.url).pathname;
const out = process.argv[2];
if (!out) {
  console.error("usage: node build.mjs OUT.html");
  process.exit(2);
}

async function bundle(entry) {
  const result = await esbuild.build({
    entryPoints: [here + entry],
    bundle: true,
    minify: true,
    write: false,
    format: "iife",
    target: ["chrome100", "firefox113", "safari16.4"],
    charset: "utf8",
    // The licences of what is bundled stay with it.
    legalComments: "inline",
  });
  return result.outputFiles[0].text.trim();
}

const licence = readFileSync(new URL("node_modules/three/LICENSE", import.meta.url), "utf8").trim();
const parts = {
  "@THREE_LICENCE@": licence,
  "@ARBORCAM_STYLE@": await bundle("style.css"),
  "@ARBORCAM_SCRIPT@": await bundle("main.js"),
};
let page = readFileSync(here + "index.html", "utf8");
// A function: `$` in the code means nothing then.
for (const [mark, text] of Object.entries(parts)) page = page.replace(mark, () => text);
writeFileSync(out, page);
console.log(`${out}: ${(page.length / 1e3).toFixed(0)} kB`);
