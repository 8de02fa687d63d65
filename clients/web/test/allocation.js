// Counts what the core allocates: node --expose-gc --max-semi-space-size=256 allocation.js PICTURES
// PICTURES: how often each chunk (.2 s) is shown. Prints bytes of heap per chunk in the best of ten windows of 1,000 chunks,
// after warm-up and 10,000 chunks more. What a chunk needs is in every window; what the engine takes for itself, as when it
// compiles, is not. A window in which it collects garbage, and then holds less than before, does not count.

import { BASES, MotionPlayer, Retarget, Rig, SmoothRoot, mapBones } from "../src/core/index.js";
import { batch, header } from "./crowd.js";
import { golden } from "./golden.js";

const AGENTS = 25;
const WARM = 400;
const COUNTED = 10_000 / AGENTS;
const WINDOWS = 10;
const PICTURES = Number(process.argv[2]);

const rigs = golden("retarget.json").cases.filter(({ basis }) => basis === "gltf");
const messages = Array.from({ length: WARM + 2 * COUNTED }, (_, seq) => batch(AGENTS, seq));
const characters = new Map();
const player = new MotionPlayer({
  added: ({ agent }) => {
    const { nodes, humanoid } = rigs[agent.alias % rigs.length];
    const retarget = new Retarget(mapBones(new Rig(nodes), humanoid), agent.restOffsets);
    characters.set(agent.alias, { retarget, root: new SmoothRoot(BASES.gltf) });
  },
});
const show = (played, alias) => {
  const { retarget, root } = characters.get(alias);
  retarget.pose(played.frame);
  root.update(player.moment, played.frame, 0);
};

function play(seq) {
  const now = 100 + 0.2 * seq;
  player.receive(messages[seq], now);
  for (let k = 0; k < PICTURES; k += 1) {
    player.advance(now + (0.2 * k) / PICTURES);
    player.agents.forEach(show);
  }
}

player.receive(header(), 100);
for (let seq = 0; seq < WARM; seq += 1) play(seq);
gc();
for (let seq = WARM; seq < WARM + COUNTED; seq += 1) play(seq);
const begun = performance.now();
const windows = [];
for (let seq = WARM + COUNTED; seq < messages.length;) {
  const before = process.memoryUsage().heapUsed;
  for (const end = seq + COUNTED / WINDOWS; seq < end; seq += 1) play(seq);
  windows.push((process.memoryUsage().heapUsed - before) / (AGENTS * COUNTED / WINDOWS));
}
const took = performance.now() - begun;
console.log(JSON.stringify({
  chunks: player.stats.chunks - AGENTS * (WARM + COUNTED), underruns: player.underruns,
  bytesPerChunk: Math.min(...windows.filter((bytes) => bytes >= 0)), windows, microsPerChunk: (1000 * took) / (COUNTED * AGENTS),
}));
