import assert from "node:assert/strict";
import { test } from "node:test";
import { PlayoutClock, PoseTrack, mixPoses } from "../src/core/index.js";

const CHUNK = 0.2;
const FPS = 40;
const identity = [0, 0, 0, 1];
const at = (x) => Float32Array.from([x, 0, 0, ...identity]);

function push(track, time, fps, frames) {
  track.push(time, fps, frames.flatMap((frame) => [...frame]), frames.length, new Uint8Array(frames.length));
}

/** Deterministic noise in 0…1. */
function noise(seed) {
  let state = seed;
  return () => (state = (state * 16807) % 2147483647) / 2147483647;
}

/** Play `seconds` of a body that moves 1 m/s, chunks arriving `late(k)` after their time. */
function play(seconds, late, transit = 0.02, local = 500) {
  const clock = new PlayoutClock();
  const track = new PoseTrack(7);
  const arrivals = [];
  for (let k = 0; k * CHUNK < seconds; k += 1) arrivals.push({ k, when: k * CHUNK + late(k) });
  const shown = [];
  const out = new Float32Array(7);
  let lastArrival = 0;
  for (let t = 0; t < seconds; t += 1 / 60) {
    while (arrivals.length && arrivals[0].when + transit <= t) {
      const { k, when } = arrivals.shift();
      lastArrival = Math.max(lastArrival, when); // messages of a connection stay in order
      const now = local + lastArrival + transit;
      clock.observe(now, lastArrival);
      clock.observeChunk(now, k * CHUNK);
      push(track, k * CHUNK, FPS, Array.from({ length: 8 }, (_, f) => at(k * CHUNK + f / FPS)));
    }
    const moment = clock.advance(local + t);
    if (track.sample(moment, out)) shown.push({ t, x: out[0], moment });
  }
  return { shown, track, clock, end: local + seconds };
}

test("a steady stream plays without a hold and at an even pace", () => {
  const { shown, track } = play(20, () => 0);
  assert.equal(track.underruns, 0);
  const settled = shown.filter(({ t }) => t > 2);
  for (let k = 1; k < settled.length; k += 1) {
    const speed = (settled[k].x - settled[k - 1].x) * 60;
    assert.ok(speed > 0.94 && speed < 1.06, `speed ${speed} at ${settled[k].t}`);
  }
});

test("jitter below the delay is not seen", () => {
  const random = noise(7);
  const { track } = play(30, () => random() * 0.25);
  assert.equal(track.underruns, 0);
});

test("after a late burst the delay grows, and shrinks again by and by", () => {
  const { clock, end, track } = play(10, (k) => (k === 20 ? 0.6 : 0));
  assert.ok(track.underruns <= 1);
  const raised = clock.wantedDelay(end - 5.3);
  assert.ok(raised > 0.5, `raised to ${raised}`);
  assert.ok(clock.wantedDelay(end + 60) < 0.25);
});

test("the delay does not depend on how far apart the clocks are", () => {
  for (const local of [-1e6, 0.5, 3e6]) {
    const { clock, end } = play(10, () => 0, 0.05, local);
    assert.ok(Math.abs(clock.delay(end) - clock.wantedDelay(end)) < 0.03);
  }
});

test("a tab that slept jumps to the present", () => {
  const clock = new PlayoutClock();
  clock.observe(100, 0);
  const before = clock.advance(100);
  clock.observe(400, 300);
  assert.ok(clock.advance(400) - before > 299);
});

test("an underrun holds the pose, and the stream is joined again without a jump", () => {
  const track = new PoseTrack(7);
  const out = new Float32Array(7);
  push(track, 0, FPS, [at(0), at(1)]);
  for (const t of [0, 0.02, 0.1, 0.5]) track.sample(t, out);
  assert.equal(out[0], 1);
  assert.equal(track.underruns, 1);
  push(track, 0.05, FPS, Array.from({ length: 40 }, (_, k) => at(2 + k)));
  let last = out[0];
  track.sample(0.51, out);
  assert.ok(Math.abs(out[0] - last) < 0.5, `jumped to ${out[0]}`);
  for (let t = 0.52; t < 0.75; t += 0.01) {
    track.sample(t, out);
    assert.ok(out[0] >= last - 1e-3);
    last = out[0];
  }
  assert.ok(Math.abs(out[0] - (2 + (0.74 - 0.05) * FPS)) < 0.5);
});

test("before the first frame there is no pose; before its time it waits on the first", () => {
  const track = new PoseTrack(7);
  const out = new Float32Array(7);
  assert.equal(track.sample(0, out), false);
  push(track, 10, FPS, [at(3), at(4)]);
  assert.equal(track.sample(9, out), true);
  assert.equal(out[0], 3);
  assert.equal(track.underruns, 0);
});

test("frames sent twice are dropped and a hidden tab's memory is bounded", () => {
  const track = new PoseTrack(7);
  const frames = Array.from({ length: 8 }, (_, k) => at(k));
  push(track, 0, FPS, frames);
  push(track, 0, FPS, frames.map(() => at(99)));
  const out = new Float32Array(7);
  track.sample(0.1, out);
  assert.equal(out[0], 4);
  for (let k = 1; k < 1000; k += 1) push(track, k * CHUNK, FPS, frames);
  assert.ok(track.buffered(999 * CHUNK + 0.175) < 1e-6);
  assert.ok(track.length <= 400);
});

test("rotations take the shorter arc and stay of unit length", () => {
  const half = Math.SQRT1_2;
  const a = Float32Array.from([0, 0, 0, 0, 0, 0, 1]);
  const b = Float32Array.from([2, 0, 0, 0, 0, -half, -half]); // 90° about z, opposite sign
  const out = new Float32Array(7);
  mixPoses(a, 0, b, 0, 0.5, out, 7);
  assert.equal(out[0], 1);
  const angle = 2 * Math.atan2(out[5], out[6]);
  assert.ok(Math.abs(angle - Math.PI / 4) < 1e-6);
  assert.ok(Math.abs(Math.hypot(...out.slice(3)) - 1) < 1e-6);
  mixPoses(a, 0, a, 0, 0.3, out, 7);
  assert.deepEqual([...out], [...a]);
});
