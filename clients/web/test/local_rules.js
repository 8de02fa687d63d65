// Rules of local mode on the rows in a file, as JSON: the choice of the next mode, and feet that are moved.
// node test/local_rules.js ROWS.json

import { readFile } from "node:fs/promises";
import { LegPose, moveAnkles } from "../src/local/legs.js";
import { Steering } from "../src/local/steering.js";

const { constants, gaits, legs, poses } = JSON.parse(await readFile(process.argv[2], "utf8"));
const steering = new Steering(constants);
const measured = Object.fromEntries(Object.entries(legs).map(([name, values]) => [name, Float64Array.from(values)]));
console.log(JSON.stringify({
  gaits: gaits.map(({ gait, start, goal, ready }) => {
    const after = steering.decide(gait, start, goal, ready), { mode, rested } = after;
    const { place, speed, facing } = steering.targets(after, start, goal);
    return { mode, rested, numbers: [after.slowSeconds, ...after.stopPlace, ...after.stopFacing, ...place, speed, ...facing] };
  }),
  poses: poses.map((one) => {
    const [translation, rotations, shift] = [one.translation, one.rotations, one.shift].map(
      (values) => Float64Array.from(values));
    const moved = rotations.slice();
    moveAnkles(new LegPose(measured, translation, rotations), shift, moved);
    return [...moved];
  }),
}));
