// People who wander without a server. Made into a static folder by `make demo`.

import { BONES } from "./client/core/index.js";
import { LocalSession } from "./client/local/index.js";
import { Bodies } from "./viewer/bodies.js";
import { planePoint } from "./viewer/ground.js";
import { Stage } from "./viewer/scene.js";
import { Raycaster, Vector2 } from "./viewer/vendor/three.min.js";

const FIRST = 10, MORE = 8, MOST = 50;
const AREA = { middle: { x: 0, z: 0 }, radius: 7 }; // metres, where people walk about
const DRAGGED = 5; // pixels beyond which a press is no click
const RESTED = 4; // seconds that somebody stands where he was sent before he walks on

const part = (id) => document.getElementById(id);
const stage = new Stage(part("view"));
const bodies = new Bodies();
const people = new Map(); // alias → { played, body }
let made = 0; // people so far
let busy = false;

stage.add(bodies.group);
const looks = await (await fetch("bodies/looks.json")).json();
let megabytes = 0;
let session;
try {
  session = await LocalSession.open({
    model: new URL("people/", document.baseURI),
    runtime: new URL("onnxruntime/ort.wasm.min.mjs", document.baseURI),
    on: {
      loaded: (bytes) => {
        megabytes += bytes / 1e6;
        part("state").textContent = `loading, ${megabytes.toFixed(1)} MB`;
      },
      added: (played) => dress(played),
      removed: ({ agent }) => {
        people.get(agent.alias)?.body?.remove();
        people.delete(agent.alias);
      },
      event: ({ kind, agentId }) => {
        if (kind === "path_done") walkOn(agentId);
      },
      failed: (reason) => { part("state").textContent = `stopped: ${reason}`; },
    },
  });
} catch (error) {
  part("state").textContent = `People could not be loaded: ${error.message}`;
  throw error;
}
globalThis.demo = { session, people, stage, send };

/** A person who has stood where a click sent him walks about again, unless another click has sent him on. */
function walkOn(id) {
  const found = people.get(Number(id)), orders = found?.orders;
  setTimeout(() => {
    if (found && people.get(Number(id)) === found && found.orders === orders) session.api.wander(id, AREA.middle, AREA.radius);
  }, 1000 * RESTED);
}

/** @param {any} played */
async function dress(played) {
  const entry = { played, body: null, orders: 0 };
  people.set(played.agent.alias, entry);
  const look = looks[(played.agent.alias - 1) % looks.length];
  entry.body = await bodies.load(`bodies/${look.file}`, {}, BONES);
  if (!people.has(played.agent.alias)) entry.body.remove();
}

/** So many more people, who walk about. */
async function add(count) {
  const specs = Array.from({ length: Math.min(count, MOST - people.size) }, () => {
    const number = made++;
    const { gender, betas } = looks[number % looks.length];
    const angle = 2.4 * number, away = AREA.radius * Math.sqrt(((number * 0.618) % 1) * 0.9 + 0.05);
    const position = { x: away * Math.cos(angle), z: away * Math.sin(angle) };
    return { name: `person ${number + 1}`, gender, betas, position, heading: angle, seed: number };
  });
  const created = await session.createAgents(specs);
  await Promise.all(created.map(({ agent_id: id }) => session.api.wander(id, AREA.middle, AREA.radius)));
}

async function remove(count) {
  const last = [...people.keys()].slice(-Math.min(count, people.size - 1));
  await Promise.all(last.map((alias) => session.api.deleteAgent(String(alias))));
}

/** The nearest person goes to a place of the ground; returns who. @param {{ x: number, z: number }} place */
function send({ x, z }) {
  const gap = ({ played: { frame } }) => Math.hypot(frame[0] - x, frame[2] - z);
  const [nearest] = [...people.values()].filter(({ played }) => played.shown).sort((a, b) => gap(a) - gap(b));
  if (!nearest) return null;
  nearest.orders += 1;
  session.api.setPath(nearest.played.agent.id, [{ x, z }]);
  return nearest.played.agent;
}

let pressed = null;
part("view").addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
part("view").addEventListener("pointerup", (event) => {
  if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > DRAGGED) return;
  const { clientWidth: width, clientHeight: height } = part("view");
  const caster = new Raycaster();
  caster.setFromCamera(new Vector2((2 * event.clientX) / width - 1, 1 - (2 * event.clientY) / height), stage.camera);
  const place = planePoint(caster.ray);
  const sent = place && send(place);
  if (sent) part("state").textContent = `${sent.name} goes there`;
});

for (const [id, act] of [["more", () => add(MORE)], ["fewer", () => remove(MORE)]]) {
  part(id).addEventListener("click", async () => {
    if (busy) return;
    busy = true;
    try {
      await act();
    } finally {
      busy = false;
      part("more").disabled = people.size >= MOST;
      part("fewer").disabled = people.size <= 1;
    }
  });
}

let before = { rows: 0, graphMs: 0, otherMs: 0, waited: 0 };
setInterval(async () => {
  const now = await session.figures(), rows = now.rows - before.rows;
  if (rows) {
    const each = (now.graphMs + now.otherMs - before.graphMs - before.otherMs) / rows;
    const waited = now.waited > before.waited ? "; too many for this machine: time waits" : "";
    part("figures").textContent = `${people.size} people; a person's 0.2 s takes ${each.toFixed(1)} ms: ${Math.floor(200 / each)} people per core${waited}`;
  }
  before = now;
}, 2000);

await add(FIRST);
part("state").textContent = "ready";
part("more").disabled = false;
part("fewer").disabled = false;
stage.begin(() => {
  const moment = session.update();
  for (const { played, body } of people.values()) if (played.shown) body?.pose(played.frame);
  bodies.update(moment);
  stage.render();
});
