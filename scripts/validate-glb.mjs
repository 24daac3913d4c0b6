// Checks GLB and glTF files with Khronos' glTF validator; exit status 1 on any error or warning.
//
//   scripts/test-modules.sh
//   NODE_PATH=target/test-npm/node_modules node scripts/validate-glb.mjs FILE.glb ...
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";

// `import` does not look at NODE_PATH, `require` does.
const validator = createRequire(import.meta.url)("gltf-validator");
const files = process.argv.slice(2);
if (files.length === 0) {
  console.error("usage: node validate-glb.mjs FILE.glb ...");
  process.exit(2);
}

let bad = false;
for (const file of files) {
  const beside = async (uri) => new Uint8Array(readFileSync(join(dirname(file), decodeURIComponent(uri))));
  const options = { maxIssues: 100, externalResourceFunction: beside };
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), options);
  const { numErrors, numWarnings, numInfos, numHints, messages } = report.issues;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos, ${numHints} hints`);
  for (const m of messages) console.log(`  ${["error", "warning", "info", "hint"][m.severity]} ${m.code} ${m.pointer}: ${m.message}`);
  const info = report.info;
  console.log(`  ${info.totalTriangleCount} triangles, ${info.totalVertexCount} vertices, ${info.animationCount} animations`);
  bad ||= numErrors + numWarnings > 0;
}
process.exit(bad ? 1 : 0);
