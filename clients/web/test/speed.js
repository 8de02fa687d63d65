// CPU time of 64 agents: decoded, sampled and put on characters, at 60 pictures a second. node test/speed.js

import { MotionPlayer, Retarget, Rig, mapBones } from "../src/core/index.js";
import { batch, header } from "./crowd.js";
import { golden } from "./golden.js";

const AGENTS = 64;
const PICTURES = 12; // of each 0.2 s
const SECONDS = [6, 30]; // to warm up, and counted

const rigs = golden("retarget.json").cases.filter(({ basis }) => basis === "gltf");
const characters = new Map();
const player = new MotionPlayer({
  added: ({ agent }) => {
    const { nodes, humanoid } = rigs[agent.alias % rigs.length];
    characters.set(agent.alias, new Retarget(mapBones(new Rig(nodes), humanoid), agent.restOffsets));
  },
});
const show = (played, alias) => characters.get(alias).pose(played.frame);

/** CPU milliseconds of one picture, from message `seq` on. */
function milliseconds(seconds, from) {
  const messages = Array.from({ length: 5 * seconds }, (_, k) => batch(AGENTS, from + k));
  const before = process.cpuUsage();
  messages.forEach((message, k) => {
    const now = 100 + 0.2 * (from + k);
    player.receive(message, now);
    for (let picture = 0; picture < PICTURES; picture += 1) {
      player.advance(now + (0.2 * picture) / PICTURES);
      player.agents.forEach(show);
    }
  });
  const { user, system } = process.cpuUsage(before);
  return (user + system) / 1000 / (5 * seconds * PICTURES);
}

player.receive(header(), 100);
milliseconds(SECONDS[0], 0);
const each = milliseconds(SECONDS[1], 5 * SECONDS[0]);
console.log(`${AGENTS} agents: ${each.toFixed(2)} ms of CPU per picture (Node ${process.version})`);
