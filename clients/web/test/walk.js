// One agent of a live server walks to a goal, on a character of each engine, and on a body that the server hands out as
// a GLB, read by three.js' own loader. Their bones are read back. Runs in Node (live.js) and in a page (live_page.html).

import { Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Session } from "../src/index.js";
import { ThreeCharacter } from "../src/three.js";
import { ENGINES, threePicture } from "./engines.js";

const GOAL = { x: 1.5, z: 2 };
const PATIENCE = 60; // seconds
const STOOD = 0.5; // seconds on both feet that end a walk: in mid-stride both touch the ground for 0.2 s at most
const RIGS = { three: "a_pose", vrm: "vrm1", babylon: "centimetres" };
const FEET = ["left_ankle", "right_ankle"];

/** The body of another person than the agent. */
async function bodyFile(api, server) {
  const [, { glb_path: path }] = await api.bodies();
  const url = new URL(path, server);
  url.searchParams.set("betas", [1.5, -0.5, 0, 0, 0, 0, 0, 0, 0, 0].join(","));
  url.searchParams.set("detail", "low");
  const file = await fetch(url);
  check(file.ok, `the body: HTTP ${file.status}`);
  const { scene } = await new GLTFLoader().parseAsync(await file.arrayBuffer(), "");
  scene.updateMatrixWorld(true);
  return scene;
}

function check(right, text) {
  if (!right) throw new Error(text);
}

/**
 * Walk. `cases`: characters of the golden traces; `picture()`: a promise of the next one. Resolves to { walked: lines of
 * text, stats }; rejects where a bone is not where it should be.
 */
export async function walk(server, cases, picture) {
  const characters = [];
  let walker = null, arrived = 0, failed = null;
  let standsSince = NaN; // moment from which both feet have been on the ground
  const session = await Session.open(server, {
    query: { encoding: "smallest_three", fps: 20 },
    on: {
      added: (played) => {
        walker = played;
        for (const [engine, name] of Object.entries(RIGS)) {
          const { nodes, humanoid, map } = cases.find((found) => found.name === name);
          const number = (bone) => nodes.findIndex((node) => node.name === map[bone]);
          const made = ENGINES[engine](nodes, humanoid, played.agent.restOffsets);
          characters.push({ engine, ...made, hips: number("pelvis"), feet: FEET.map(number), most: 0 });
        }
        characters.push({
          engine: "glb", character: new ThreeCharacter(body, played.agent.restOffsets), most: 0, settle: threePicture(body),
          place: (bone) => body.getObjectByName(bone).getWorldPosition(new Vector3()).toArray(),
          hips: "pelvis", feet: FEET,
        });
      },
      event: ({ kind, at }) => {
        if (kind === "path_done") arrived = at;
      },
      failed: (reason) => { failed = reason; },
    },
  });
  const body = await bodyFile(session.api, server);
  const [{ agent_id: id }] = await session.createAgents([{ name: "Ada" }]);
  await session.api.setPath(id, [GOAL]);

  const end = performance.now() + 1000 * PATIENCE;
  while (performance.now() < end) {
    await picture();
    check(failed === null, failed);
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
  check(arrived, "it has not arrived");
  const walked = characters.map(({ engine, place, hips, feet, most, character }) => {
    const [x, y, z] = place(hips);
    check(Math.hypot(x - GOAL.x, z - GOAL.z) < 0.5, `${engine}: hips at ${x}, ${z}`);
    // the ratio is that of the thigh joints, and hips sink a little for short legs: the traces hold it to a digit
    check(Math.abs(y / (character.retarget.ratio * walker.frame[1]) - 1) < 0.04, `${engine}: hips ${y} m high`);
    for (const foot of feet) check(place(foot)[1] > 0.03 && place(foot)[1] < 0.2, `${engine}: ankle ${place(foot)[1]} m high`);
    check(most < 0.3, `${engine}: a standing foot's ankle ${most} m high`);
    return `${engine}: walked to ${x.toFixed(2)}, ${z.toFixed(2)}`;
  });
  const { messages, chunks, gaps } = session.player.stats;
  session.close();
  return { walked, stats: { messages, chunks, gaps, underruns: session.player.underruns } };
}
