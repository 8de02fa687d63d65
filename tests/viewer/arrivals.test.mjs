import assert from "node:assert/strict";
import test from "node:test";

import { Arrivals } from "../../viewer/arrivals.js";

function shown() {
  const lines = [];
  const element = () => ({ dataset: {}, remove() {} });
  globalThis.document = { createElement: element, getElementById: () => ({ children: [], append: (line) => lines.push(line.textContent) }) };
  return lines;
}

function arrivals(room, status = 429) {
  const asked = [], walking = [];
  const api = {
    createAgents: async (_, people, patience) => {
      asked.push([people.length, patience]);
      if (people.length > room) throw Object.assign(new Error("no room"), { status });
      room -= people.length;
      return people.map((_person, k) => ({ agent_id: `${asked.length}-${k}` }));
    },
  };
  const made = new Arrivals({
    api,
    place: { settled: Promise.resolve(), level: {}, book: {} },
    session: { id: "s" },
    crowd: { people: [] },
    stage: {},
    commands: { roamAgent: async (id) => walking.push(id) },
  });
  made.bodies = new Map([["male", { min_height_m: 1.6, max_height_m: 1.9, glb_path: "" }], ["female", { min_height_m: 1.5, max_height_m: 1.8, glb_path: "" }]]);
  made.mesh = () => { throw new Error("not asked for"); };
  return { made, asked, walking };
}

test("as many people come as there is room for, and the page says how many", async (context) => {
  context.mock.timers.enable({ apis: ["setTimeout"] });
  globalThis.fetch = async () => ({ arrayBuffer: async () => null });
  const lines = shown();
  const { made, asked, walking } = arrivals(6);
  made.mesh = () => ["http://x/", {}];
  await made.roamers(8);
  assert.deepEqual(asked.map(([count]) => count), [8, 4, 4, 2, 2, 1]);
  assert.ok(asked.every(([, patience]) => patience === 0)); // the rest is asked for later, in silence
  assert.equal(walking.length, 6);
  assert.deepEqual(lines, ["6 of 8 people came; this computer is busy"]);
  assert.ok(made.busy);
  assert.equal(made.nobody, "People are coming"); // none of them has been seen
});

test("people come later to a server that was too busy to answer at all", async (context) => {
  context.mock.timers.enable({ apis: ["setTimeout"] });
  globalThis.fetch = async () => ({ arrayBuffer: async () => null });
  const lines = shown();
  const { made, asked, walking } = arrivals(8, 503);
  const { createAgents } = made.api;
  made.mesh = () => ["http://x/", {}];
  made.api.createAgents = () => Promise.reject(Object.assign(new Error("busy"), { status: 503 }));
  await made.roamers(8);
  assert.deepEqual(lines, ["0 of 8 people came; this computer is busy"]);
  made.api.createAgents = createAgents;
  context.mock.timers.tick(4000);
  await new Promise(setImmediate);
  assert.deepEqual(asked, [[8, 0]]);
  assert.equal(walking.length, 8);
  assert.ok(!made.busy);
});

test("a server is busy that shows nobody for seconds, and nobody comes after the last request", async (context) => {
  context.mock.timers.enable({ apis: ["setTimeout"] });
  let now = 0;
  context.mock.method(performance, "now", () => now);
  shown();
  const { made } = arrivals(0);
  assert.equal(made.nobody, "Add people first");
  made.expect();
  now = 2000;
  assert.ok(!made.busy);
  now = 4000;
  assert.ok(made.busy);
  await made.roamers(1);
  for (let k = 0; k < 30; k += 1) {
    assert.equal(made.nobody, "People are coming");
    context.mock.timers.tick(4000);
    for (let turn = 0; turn < 3; turn += 1) await new Promise(setImmediate);
  }
  assert.equal(made.nobody, "Add people first");
  assert.ok(!made.busy);
});

test("people are said to be sent once each has its command and its body is requested, before any answer", async () => {
  const bodies = [];
  globalThis.fetch = async (url) => bodies.push(url) && new Promise(() => {});
  const { made, walking } = arrivals(8);
  made.mesh = ({ agent_id: id }) => [`http://x/${id}`, {}];
  const { roamAgent } = made.commands;
  made.commands.roamAgent = (id) => roamAgent(id) && new Promise(() => {}); // no answer
  await new Promise((sent) => made.roamers(8, null, sent));
  assert.equal(walking.length, 8);
  assert.equal(bodies.length, 8);
});

test("another refusal is told as it is", async () => {
  const { made, asked } = arrivals(0, 400);
  const adding = made.roamers(8);
  assert.equal(made.nobody, "People are coming");
  await assert.rejects(adding, /no room/);
  assert.equal(made.nobody, "Add people first");
  assert.equal(asked.length, 1);
});
