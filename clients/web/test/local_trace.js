// Local mode on onnxruntime-web, held to a trace of the server. node test/local_trace.js EXPORT TRACE.json [SCENE]
// Prints, as JSON, how far each person's frames are from the server's.

import { readFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";
import { MODES } from "../src/local/steering.js";
import { openExport } from "../src/local/graphs.js";
import { LocalScene } from "../src/local/scene.js";
import { LocalWorld } from "../src/local/world.js";

const FPS = 40;
const [folder, traced, scenery] = process.argv.slice(2);
const ort = await import("onnxruntime-web/wasm");
ort.env.wasm.numThreads = 1;
ort.env.wasm.wasmPaths = new URL(".", import.meta.resolve("onnxruntime-web/wasm")).href;

const reader = (from) => async (name) => {
  const { buffer, byteOffset, byteLength } = await readFile(new URL(name, `${pathToFileURL(from).href}/`));
  return buffer.slice(byteOffset, byteOffset + byteLength);
};
const read = reader(folder);
const { about, bodies, run } = await openExport(read, ort);
const { people: specs, commands, chunks, seconds, avoid } = JSON.parse(await readFile(traced, "utf8"));
const scene = scenery ? await LocalScene.read(reader(scenery)) : null;
const met = [];
const world = new LocalWorld(about, bodies, run, scene, (person, kind, waypoint, what) => {
  met.push({ who: people.indexOf(person), kind, waypoint, what: kind === "blocked" ? what.map((other) => people.indexOf(other)) : what });
}, avoid);
const people = specs.map((spec) => world.add({ ...spec, seed: BigInt(spec.seed) }, 0));
const own = people.map(() => []);

const began = performance.now();
for (const { at, who, goals } of [...commands, { at: seconds }]) {
  await world.advance(FPS * at + 1e-3, (person, chunk) => own[people.indexOf(person)].push(chunk));
  if (goals) people[who].give(goals, FPS * at);
}
const milliseconds = performance.now() - began;

const apart = (a, b) => a.reduce((most, value, k) => Math.max(most, Math.abs(value - b[k])), 0);
const found = own.map((mine, who) => mine.map((chunk, k) => {
  const theirs = chunks[who][k];
  return {
    hips: apart(chunk.translation, theirs.translation),
    turns: apart(chunk.rotations, theirs.rotations),
    state: MODES[chunk.mode].toLowerCase().replace("strafing", "walking") === theirs.state,
    notes: chunk.flags === theirs.flags && chunk.waypoint === theirs.waypoint && chunk.seq === theirs.seq,
    contacts: [...chunk.contacts].every((contact, n) => contact === theirs.contacts[n]),
  };
}));
const count = (rows, name) => rows.filter((row) => !row[name]).length;
console.log(JSON.stringify({
  milliseconds, met, ...world.stats,
  people: found.map((rows, who) => ({
    chunks: [rows.length, chunks[who].length],
    hips: Math.max(...rows.map(({ hips }) => hips)),
    turns: Math.max(...rows.map(({ turns }) => turns)),
    early: Math.max(...rows.slice(0, 50).map(({ hips, turns }) => Math.max(hips, turns))), // in 10 s
    otherStates: count(rows, "state"), otherNotes: count(rows, "notes"), otherContacts: count(rows, "contacts"),
    resets: people[who].resets,
  })),
}));
