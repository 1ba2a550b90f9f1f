// Runs Khronos' glTF validator over GLB files: node validate-gltf.mjs FOLDER_WITH_NODE_MODULES FILE…
// Prints one JSON line per file: { file, errors, warnings, messages, animations, triangles }.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join, resolve } from 'node:path';

const [folder, ...files] = process.argv.slice(2);
const validator = createRequire(join(resolve(folder), 'package.json'))('gltf-validator');
for (const file of files) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 0 });
  const { numErrors, numWarnings, messages } = report.issues;
  console.log(JSON.stringify({
    file,
    errors: numErrors,
    warnings: numWarnings,
    messages: messages.filter((message) => message.severity < 2),
    animations: report.info?.animationCount,
    triangles: report.info?.totalTriangleCount,
  }));
}
