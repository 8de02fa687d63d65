// CPU time of 64 agents: decoded, sampled and put on characters, at 60 pictures a second. node test/speed.js; in Chromium:
// python -m benchmarks.page_speed

import { MotionPlayer, Retarget, Rig, mapBones } from "../src/core/index.js";
import { batch, header } from "./crowd.js";
import { golden } from "./golden.js";

const AGENTS = 64;
const PICTURES = 12; // of each 0.2 s
const WARM = 6; // seconds
const SECONDS = 30; // counted

const rigs = golden("retarget.json").cases.filter(({ basis }) => basis === "gltf");
const characters = new Map();
const player = new MotionPlayer({
  added: ({ agent }) => {
    const { nodes, humanoid } = rigs[agent.alias % rigs.length];
    characters.set(agent.alias, new Retarget(mapBones(new Rig(nodes), humanoid), agent.restOffsets));
  },
});
const show = (played, alias) => characters.get(alias).pose(played.frame);

/** The messages of this many seconds, from message `from` on. */
export function stream(seconds, from) {
  return Array.from({ length: 5 * seconds }, (_, k) => batch(AGENTS, from + k));
}

/** Show them all, picture by picture; how many pictures. */
export function play(messages, from) {
  messages.forEach((message, k) => {
    const now = 100 + 0.2 * (from + k);
    player.receive(message, now);
    for (let picture = 0; picture < PICTURES; picture += 1) {
      player.advance(now + (0.2 * picture) / PICTURES);
      player.agents.forEach(show);
    }
  });
  return messages.length * PICTURES;
}

player.receive(header(), 100);
play(stream(WARM, 0), 0);
export const counted = stream(SECONDS, 5 * WARM);
export const begun = 5 * WARM;

if (!globalThis.document) {
  const before = process.cpuUsage();
  const pictures = play(counted, begun);
  const { user, system } = process.cpuUsage(before);
  console.log(`${AGENTS} agents: ${((user + system) / 1000 / pictures).toFixed(2)} ms of CPU per picture (Node ${process.version})`);
}
