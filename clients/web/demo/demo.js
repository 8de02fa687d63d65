// People who wander without a server. Made into a static folder by `make demo`.

import { Bodies } from "./viewer/bodies.js";
import { CharacterFile } from "./viewer/character.js";
import { BONES } from "./viewer/client/core/index.js";
import { LocalSession } from "./viewer/client/local/index.js";
import { watchFiles } from "./viewer/files.js";
import { Level } from "./viewer/scene_level.js";
import { Stage } from "./viewer/scene.js";
import { outlinesOf } from "./viewer/scenes.js";

const FIRST = 10, MORE = 8, MOST = 50;
const AREA = { middle: { x: 0, z: 0 }, radius: 10 }; // metres, where people walk about, the fountain in the middle
const DRAGGED = 5; // pixels beyond which a press is no click
const RESTED = 4; // seconds that somebody stands where he was sent before he walks on

const part = (id) => document.getElementById(id);
const stage = new Stage(part("view"));
const bodies = new Bodies();
const level = new Level();
const people = new Map(); // alias → { played, body }
let made = 0; // people so far
let busy = false;

stage.add(bodies.group);
stage.add(level.group);
const json = async (address) => (await fetch(address)).json();
const asked = { looks: json("bodies/looks.json"), square: json("scene/outlines.json") };
let megabytes = 0;
let session;
let looks;
try {
  session = await LocalSession.open({
    model: new URL("people/", document.baseURI),
    runtime: new URL("onnxruntime/ort.wasm.min.mjs", document.baseURI),
    scene: new URL("scene/", document.baseURI),
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
        if (kind === "path_done" || kind === "unreachable") walkOn(agentId);
      },
      failed: (reason) => { part("state").textContent = `stopped: ${reason}`; },
    },
  });
} catch (error) {
  part("state").textContent = `People could not be loaded: ${error.message}`;
  throw error;
}
looks = await asked.looks;
level.show(outlinesOf(await asked.square));
stage.lower(level.under);
stage.approach(level);
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
  if (dressed) {
    entry.body = dressed.body(played.agent.restOffsets);
    stage.add(entry.body.object);
    return;
  }
  const look = looks[(played.agent.alias - 1) % looks.length];
  entry.body = await bodies.load(() => [`bodies/${look.file}`, {}], BONES);
  if (!people.has(played.agent.alias)) entry.body.remove();
}

let dressed = null; // the character of the next person

/** Somebody in the user's own character comes before the camera, and walks about. */
async function wear(file) {
  part("state").textContent = `reading ${file.name}`;
  try {
    const look = await CharacterFile.read(await file.arrayBuffer(), file.name);
    if (look.problem) throw new Error(look.problem);
    const { area: { x, z } } = stage.approach(level);
    dressed = look;
    const [{ agent_id: id }] = await session.createAgents([{ name: look.title, position: { x, z }, heading: 0, seed: made++ }]);
    await session.api.wander(id, AREA.middle, AREA.radius);
    part("state").textContent = `${look.title} walks, and stays in this page`;
  } catch (error) {
    part("state").textContent = `${file.name}: ${error.message}`;
  } finally {
    dressed = null;
  }
}
watchFiles([[part("character"), "character"]], wear);

/** This many more people, who walk about. */
async function add(count) {
  const specs = Array.from({ length: Math.min(count, MOST - people.size) }, () => {
    const number = made++;
    const { gender, betas } = looks[number % looks.length];
    const angle = (2.4 * number) % (2 * Math.PI), away = 4.5 + 5 * ((number * 0.618) % 1); // around the fountain
    const position = { x: away * Math.sin(angle), z: away * Math.cos(angle) };
    return { name: `person ${number + 1}`, gender, betas, position, heading: angle, seed: number };
  });
  const created = await session.createAgents(specs);
  await Promise.all(created.map(({ agent_id: id }) => session.api.wander(id, AREA.middle, AREA.radius)));
}

async function remove(count) {
  const last = [...people.keys()].slice(-Math.min(count, people.size - 1));
  await Promise.all(last.map((alias) => session.api.deleteAgent(String(alias))));
}

/** The nearest person goes to a place of the ground; resolves to who. @param {{ x: number, z: number }} place */
async function send({ x, z }) {
  const gap = ({ played: { frame } }) => Math.hypot(frame[0] - x, frame[2] - z);
  const [nearest] = [...people.values()].filter(({ played }) => played.shown).sort((a, b) => gap(a) - gap(b));
  if (!nearest) return null;
  nearest.orders += 1;
  await session.api.setPath(nearest.played.agent.id, [{ x, z }]);
  return nearest.played.agent;
}

let pressed = null;
part("view").addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
part("view").addEventListener("pointerup", async (event) => {
  if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > DRAGGED) return;
  const place = level.meets(stage.ray(event))?.point;
  if (!place) return;
  try {
    const sent = await send(place);
    if (sent) part("state").textContent = `${sent.name} goes there`;
  } catch (error) {
    part("state").textContent = error.message;
  }
});

for (const [id, act] of [["more", () => add(MORE)], ["fewer", () => remove(MORE)]]) {
  part(id).addEventListener("click", async () => {
    if (busy) return;
    busy = true;
    try {
      await act();
    } catch (error) {
      part("state").textContent = error.message;
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
    const waited = now.waited > before.waited ? "; it is behind, so they move in slow motion" : "";
    part("figures").textContent = `${people.size} people; this computer can move about ${Math.floor(200 / each)} on each core${waited}`;
  }
  before = now;
}, 2000);

await add(FIRST);
part("state").textContent = "ready";
part("more").disabled = false;
part("fewer").disabled = false;
stage.begin(() => {
  session.update();
  level.reveal(stage.camera.position, stage.controls.target);
  for (const { played, body } of people.values()) if (played.shown) body?.pose(played.frame);
  stage.render();
});
