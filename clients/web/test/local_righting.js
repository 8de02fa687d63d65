// Steps of the bodies in a file, straightened up by local mode, as JSON. node test/local_righting.js STEPS.json

import { readFile } from "node:fs/promises";
import { righted, sharesOf } from "../src/local/righting.js";

const { names, steps } = JSON.parse(await readFile(process.argv[2], "utf8"));
const shares = sharesOf(names);
console.log(JSON.stringify(steps.map(({ mode, translation, rotations, markers }) => {
  const step = {
    translation: Float64Array.from(translation), rotations: Float64Array.from(rotations),
    markers: Float32Array.from(markers), contacts: new Uint8Array(16),
  };
  const found = righted(mode, step, shares);
  return { same: found === step, rotations: [...found.rotations], markers: [...found.markers] };
})));
