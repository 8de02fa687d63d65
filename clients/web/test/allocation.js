// Counts what the core allocates: node --expose-gc --max-semi-space-size=256 allocation.js PICTURES
// PICTURES: how often each chunk (.2 s) is shown. Prints bytes of heap per chunk in the best of ten windows of 1,000 chunks,
// after warm-up and 10,000 chunks more. What a chunk needs is in every window; what the engine takes for itself, as when it
// compiles, is not. A window in which it collects garbage, and then holds less than before, does not count.
// Code that runs once per message boxes each number until the engine has compiled it: after some thousand messages, here
// of one agent each.

import { BASES, MotionPlayer, Retarget, Rig, SmoothRoot, mapBones } from "../src/core/index.js";
import { batch, header } from "./crowd.js";
import { golden } from "./golden.js";

const AGENTS = 25;
const ALONE = 8000; // messages of one agent
const WARM = 400; // messages of all of them
const COUNTED = 10_000 / AGENTS;
const WINDOWS = 10;
const PICTURES = Number(process.argv[2]);

const rigs = golden("retarget.json").cases.filter(({ basis }) => basis === "gltf");
const messages = Array.from({ length: WARM + 2 * COUNTED }, (_, k) => batch(AGENTS, ALONE + k, k === 0));
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

function play(seq, message) {
  const now = 100 + 0.2 * seq;
  player.receive(message, now);
  for (let k = 0; k < PICTURES; k += 1) {
    player.advance(now + (0.2 * k) / PICTURES);
    player.agents.forEach(show);
  }
}

function playAll(from, to) {
  for (let k = from; k < to; k += 1) play(ALONE + k, messages[k]);
}

/** Bytes of heap that `act` takes, with the `own` ones of two looks at the heap. */
function bytesOf(act, own = 0) {
  const before = process.memoryUsage().heapUsed;
  act();
  return process.memoryUsage().heapUsed - before - own;
}

player.receive(header(), 100);
for (let seq = 0; seq < ALONE; seq += 1) play(seq, batch(1, seq));
playAll(0, WARM);
gc();
playAll(WARM, WARM + COUNTED);
const own = Math.min(...Array.from({ length: WINDOWS }, () => bytesOf(() => {})));
const chunks = player.stats.chunks, begun = performance.now();
const windows = Array.from({ length: WINDOWS }, (_, k) => {
  const from = WARM + COUNTED + (k * COUNTED) / WINDOWS;
  return bytesOf(() => playAll(from, from + COUNTED / WINDOWS), own) / ((AGENTS * COUNTED) / WINDOWS);
});
const took = performance.now() - begun;
console.log(JSON.stringify({
  chunks: player.stats.chunks - chunks, underruns: player.underruns,
  bytesPerChunk: Math.min(...windows.filter((bytes) => bytes >= 0)), windows, microsPerChunk: (1000 * took) / (COUNTED * AGENTS),
}));
