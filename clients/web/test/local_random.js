// What follows from the seeds in a file, as JSON. node test/local_random.js SEEDS.json

import { readFile } from "node:fs/promises";
import { isMirrored, mannerOf, noiseOf, ownNoiseOf, reactionOf } from "../src/local/random.js";

const seeds = JSON.parse(await readFile(process.argv[2], "utf8")).map(BigInt);
console.log(JSON.stringify(seeds.map((seed) => ({
  own: [...ownNoiseOf(seed)], manner: [...mannerOf(seed)], noise: [...noiseOf(seed, 7)], mirrored: isMirrored(seed), reaction: reactionOf(seed, 3),
}))));
