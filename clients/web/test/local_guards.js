// The guards of local mode on the steps in a file, as JSON. node test/local_guards.js STEPS.json

import { readFile } from "node:fs/promises";
import { bendable, fallen, gotUp } from "../src/local/guards.js";

const { legs, steps } = JSON.parse(await readFile(process.argv[2], "utf8"));
const measured = { ...Object.fromEntries(Object.entries(legs).map(([name, values]) => [name, Float64Array.from(values)])), standing: legs.standing[0] };
const seedOf = ({ translation, rotations }) => ({ translation: Float32Array.from(translation), rotations: Float32Array.from(rotations) });
console.log(JSON.stringify(steps.map(({ seed, stand, translation, rotations }) => {
  const target = seedOf(stand);
  const up = gotUp(seedOf(seed), target);
  return {
    bendable: [...bendable(Float64Array.from(rotations), measured)],
    fallen: fallen(Float64Array.from(translation), Float64Array.from(rotations), measured),
    upTranslation: [...up.translation], upRotations: [...up.rotations], stand: [...target.rotations],
  };
})));
