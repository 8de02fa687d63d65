import assert from "node:assert/strict";
import { test } from "node:test";
import { keepAlive } from "../src/lease.js";

function harness(answers) {
  const asked = [];
  const timers = [];
  const api = {
    renewSession: async (sessionId) => {
      asked.push(sessionId);
      const status = answers.shift();
      if (status) throw Object.assign(new Error("refused"), { status });
    },
  };
  const stop = keepAlive(api, "s", 60, (callback, seconds) => timers.push({ callback, seconds }));
  const turn = async () => timers.shift().callback();
  return { asked, timers, stop, turn };
}

test("a lease is renewed three times in its length, failures or not", async () => {
  const { asked, timers, turn } = harness([undefined, 503, 0, undefined]);
  for (let k = 0; k < 4; k += 1) {
    assert.equal(timers[0].seconds, 20);
    await turn();
  }
  assert.equal(asked.length, 4);
});

test("a session that is no more, or was left, is not renewed", async () => {
  const gone = harness([404]);
  await gone.turn();
  assert.equal(gone.timers.length, 0);
  const left = harness([]);
  left.stop();
  await left.turn();
  assert.deepEqual([left.asked, left.timers], [[], []]);
});
