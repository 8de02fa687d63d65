import assert from "node:assert/strict";
import { test } from "node:test";
import { PoseTrack } from "../../viewer/client/index.js";
import { watchSleep } from "../../viewer/asleep.js";
import { History } from "../../viewer/history.js";

test("a page that was frozen wakes, and one whose machine slept, but not one that was only late", () => {
  const page = new EventTarget();
  let [wall, steady, woken, look] = [5000, 100, 0, null];
  watchSleep(() => { woken += 1; }, page, () => wall, () => steady, (callback) => { look = callback; });
  page.dispatchEvent(new Event("resume"));
  assert.equal(woken, 1);
  const pass = (onWall, here) => {
    wall += onWall;
    steady += here;
    look();
    return woken;
  };
  assert.equal(pass(60000, 60000), 1); // timers of hidden pages are late
  assert.equal(pass(3000, 1000), 1);
  for (const seconds of [4, 60, 600]) {
    const before = woken;
    assert.equal(pass(1000 * seconds + 1000, 1000), before + 1);
  }
  assert.equal(pass(1000, 1000), woken);
});

test("seconds in which nothing was shown are noted in thirty frames, and with all of them", () => {
  const history = new History();
  const track = new PoseTrack(7);
  track.push(0, 30, Array.from({ length: 151 }, (_, k) => [k / 30, 1, 0, 0, 0, 0, 1]).flat(), 151, new Uint8Array(151));
  const person = { agent: { alias: 1 }, played: { track, frame: new Float32Array(7) } };
  history.note(0.1, [person]);
  history.note(4.6, [person]);
  assert.equal(history.tracks.get(1).count, 30);
  const frame = new Float32Array(7);
  for (const moment of [0.5, 2, 4.4]) {
    assert.ok(history.sample(1, moment, frame));
    assert.ok(Math.abs(frame[0] - moment) < 0.01);
  }
});
