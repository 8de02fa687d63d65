// What follows from the seeds in a file, as JSON. node test/local_random.js SEEDS.json

import { readFile } from "node:fs/promises";
import { habitNumbers, isMirrored, mannerOf, reactionOf, strideOf } from "../src/local/random.js";

const seeds = JSON.parse(await readFile(process.argv[2], "utf8")).map(BigInt);
console.log(JSON.stringify(seeds.map((seed) => ({
  manner: [...mannerOf(seed)], mirrored: isMirrored(seed), reaction: reactionOf(seed, 3), stride: strideOf(seed),
  habits: habitNumbers(seed, 12),
}))));
