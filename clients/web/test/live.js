// One agent of a live server walks to a goal, on a character of each engine, and on a body that the server hands out as
// a GLB, read by three.js' own loader. Their bones are read back.
//   node --experimental-websocket live.js http://localhost:8080

import assert from "node:assert/strict";
import { setTimeout as sleep } from "node:timers/promises";
import { Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Session } from "../src/index.js";
import { ThreeCharacter } from "../src/three.js";
import { ENGINES } from "./engines.js";
import { golden } from "./golden.js";

const GOAL = { x: 1.5, z: 2 };
const PATIENCE = 60; // seconds
const STOOD = 0.5; // seconds on both feet that end a walk: in mid-stride both touch the ground for 0.2 s at most
const RIGS = { three: "a_pose", vrm: "vrm1", babylon: "centimetres" };
const { cases } = golden("retarget.json");

/** The body of another person than the agent. */
async function bodyFile(api) {
  const [, { glb_path: path }] = await api.bodies();
  const url = new URL(path, process.argv[2]);
  url.searchParams.set("betas", [1.5, -0.5, 0, 0, 0, 0, 0, 0, 0, 0].join(","));
  url.searchParams.set("detail", "low");
  const file = await fetch(url);
  assert.ok(file.ok, await file.clone().text());
  const { scene } = await new GLTFLoader().parseAsync(await file.arrayBuffer(), "");
  scene.updateMatrixWorld(true);
  return scene;
}

const characters = [];
let walker = null;
let arrived = 0;
let standsSince = NaN; // moment from which both feet have been on the ground
const session = await Session.open(process.argv[2], {
  query: { encoding: "smallest_three", fps: 20 },
  on: {
    added: (played) => {
      walker = played;
      for (const [engine, name] of Object.entries(RIGS)) {
        const { nodes, humanoid, map } = cases.find((found) => found.name === name);
        const number = (bone) => nodes.findIndex((node) => node.name === map[bone]);
        const made = ENGINES[engine](nodes, humanoid, played.agent.restOffsets);
        characters.push({ engine, ...made, hips: number("pelvis"), feet: ["left_ankle", "right_ankle"].map(number), most: 0 });
      }
      characters.push({
        engine: "glb", character: new ThreeCharacter(body, played.agent.restOffsets), most: 0,
        settle: () => body.updateMatrixWorld(),
        place: (bone) => body.getObjectByName(bone).getWorldPosition(new Vector3()).toArray(),
        hips: "pelvis", feet: ["left_ankle", "right_ankle"],
      });
    },
    event: ({ kind, at }) => {
      if (kind === "path_done") arrived = at;
    },
    failed: assert.fail,
  },
});
const body = await bodyFile(session.api);
const [{ agent_id: id }] = await session.createAgents([{ name: "Ada" }]);
await session.api.setPath(id, [GOAL]);

const end = performance.now() + 1000 * PATIENCE;
while (performance.now() < end) {
  await sleep(16);
  session.update();
  if (!walker?.shown) continue;
  for (const character of characters) {
    character.character.pose(walker.frame, 0);
    character.settle();
    // of a foot that stands, the ankle is as high as in the rest pose: it rolls, so a few centimetres more at most
    const standing = character.feet.filter((_, leg) => walker.track.contacts & (1 << leg)).map((foot) => character.place(foot)[1]);
    character.most = Math.max(character.most, ...standing);
  }
  const { moment } = session.player;
  if (walker.track.contacts !== 3) standsSince = NaN;
  else if (Number.isNaN(standsSince)) standsSince = moment;
  // the event is ahead of the picture by the playout delay, and a last step may follow
  if (arrived && moment > arrived && moment >= standsSince + STOOD) break;
}
assert.ok(arrived, "it has not arrived");
for (const { engine, place, hips, feet, most, character } of characters) {
  const [x, y, z] = place(hips);
  assert.ok(Math.hypot(x - GOAL.x, z - GOAL.z) < 0.5, `${engine}: hips at ${x}, ${z}`);
  // the ratio is that of the thigh joints, and hips sink a little for short legs: the traces hold it to a digit
  assert.ok(Math.abs(y / (character.retarget.ratio * walker.frame[1]) - 1) < 0.04, `${engine}: hips ${y} m high`);
  for (const foot of feet) assert.ok(place(foot)[1] > 0.03 && place(foot)[1] < 0.2, `${engine}: ankle ${place(foot)[1]} m high`);
  assert.ok(most < 0.3, `${engine}: a standing foot's ankle ${most} m high`);
  console.log(`${engine}: walked to ${x.toFixed(2)}, ${z.toFixed(2)}`);
}
const { messages, chunks, gaps } = session.player.stats;
console.log(JSON.stringify({ messages, chunks, gaps, underruns: session.player.underruns }));
session.close();
