import assert from "node:assert/strict";
import { test } from "node:test";
import { Crowd } from "../../viewer/crowd.js";

test("people who come and go together are reported once, since the page lists everybody each time", async () => {
  let reports = 0;
  const crowd = new Crowd({ add: () => {} }, () => 0, () => [], () => { reports += 1; }, () => {});
  const body = { height: 1.7, pose: () => {}, hide: () => {}, remove: () => {} };
  const { added, removed } = crowd.handlers(() => 0);
  const all = Array.from({ length: 300 }, (_, alias) => ({ agent: { id: `agent-${alias}`, alias }, frame: [], shown: false }));
  for (const played of all) {
    crowd.looks.set(played.agent.id, { body: () => body });
    added(played);
  }
  await new Promise((done) => setTimeout(done));
  assert.deepEqual([crowd.people.length, reports], [300, 1]);
  for (const played of all.slice(0, 200)) removed(played);
  await new Promise((done) => setTimeout(done));
  assert.deepEqual([crowd.people.length, reports], [100, 2]);
});
