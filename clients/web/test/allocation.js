// Counts what the core allocates: node --expose-gc --max-semi-space-size=256 allocation.js PICTURES
// Prints bytes of heap per chunk, over 10,000 chunks, each shown in so many pictures (of 0.2 s), after warm-up and 10,000
// chunks more, since the engine itself takes a few hundred kB after a collection. Nothing is collected meanwhile.

import { BASES, MotionPlayer, Retarget, Rig, SmoothRoot, mapBones } from "../src/core/index.js";
import { batch, header } from "./crowd.js";
import { golden } from "./golden.js";

const AGENTS = 25;
const WARM = 400;
const COUNTED = 10_000 / AGENTS;
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
const before = process.memoryUsage().heapUsed;
const begun = performance.now();
for (let seq = WARM + COUNTED; seq < messages.length; seq += 1) play(seq);
const took = performance.now() - begun;
const bytes = process.memoryUsage().heapUsed - before;
console.log(JSON.stringify({
  chunks: player.stats.chunks - AGENTS * (WARM + COUNTED), underruns: player.underruns, bytes,
  bytesPerChunk: bytes / (COUNTED * AGENTS), microsPerChunk: (1000 * took) / (COUNTED * AGENTS),
}));
