// Prints the errors and warnings the Khronos validator has for each file: "FILE CODE COUNT" lines,
// then "done". Usage: node validate_gltf.js FILE...
const fs = require('fs');
const path = require('path');
const validator = require('gltf-validator');

async function main() {
  for (const file of process.argv.slice(2)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
      uri: path.basename(file), maxIssues: 0,
    });
    const counts = {};
    for (const issue of report.issues.messages) {
      if (issue.severity <= 1) counts[issue.code] = (counts[issue.code] || 0) + 1;
    }
    for (const code of Object.keys(counts)) console.log(file, code, counts[code]);
  }
  console.log('done');
}

main().catch((error) => { console.error(error); process.exit(1); });
