import assert from "node:assert/strict";
import { test } from "node:test";
import { blockMeets } from "../../viewer/ground.js";
import { vantageOf } from "../../viewer/vantage.js";

const box = (x0, z0, x1, z1, y) => ({ top: [[x0, z0], [x1, z0], [x1, z1], [x0, z1]].map(([x, z]) => ({ x, y, z })), bottom: 0 });

/** A level where nobody walks in or within 0.2 m of a block. */
function levelOf(blocks) {
  const within = (x, z, { top: [a, , c] }) => x > a.x - 0.2 && x < c.x + 0.2 && z > a.z - 0.2 && z < c.z + 0.2;
  const ground = { heightAt: (x, z) => (blocks.some((block) => within(x, z, block)) ? null : 0) };
  return {
    base: 0, ground, heightAt: (x, z) => ground.heightAt(x, z) ?? 0, solids: blocks,
  };
}

const MIDDLE = { x: 5, z: -2 };
const DESK = { opening: 0.61, tall: false }, PHONE = { opening: 0.26, tall: true };

/** Whether a block stands between the eye and a walker at the spot. */
function hides(block, eye, area) {
  const way = { x: area.x - eye.x, y: 1 - eye.y, z: area.z - eye.z }, reach = Math.hypot(way.x, way.y, way.z);
  return blockMeets({ origin: eye, direction: { x: way.x / reach, y: way.y / reach, z: way.z / reach } }, block) < reach;
}

test("on free ground people walk in the middle, and are seen from near, also on a phone that is held upright", () => {
  for (const window of [DESK, PHONE]) {
    const { tall } = window;
    const { eye, target, area, count } = vantageOf(levelOf([]), MIDDLE, window);
    assert.deepEqual(area, { ...MIDDLE, radius: tall ? 0.8 * 2.8 : 2.8 });
    assert.equal(count, 10);
    assert.ok(Math.hypot(eye.x - target.x, eye.y - target.y, eye.z - target.z) < 13);
  }
});

test("people walk before what stands in the middle, and it is seen behind them", () => {
  const { eye, target, area } = vantageOf(levelOf([box(2, -5, 8, 1, 0.8)]), MIDDLE, DESK);
  const out = Math.hypot(area.x - MIDDLE.x, area.z - MIDDLE.z);
  assert.ok(out > 3 && out < 7);
  assert.ok(Math.hypot(eye.x - MIDDLE.x, eye.z - MIDDLE.z) > out + 5);
  assert.ok(Math.hypot(target.x - MIDDLE.x, target.z - MIDDLE.z) < out);
});

test("in a corridor fewer people come, and are seen along it or over its walls", () => {
  const walls = [box(-10, -4, 20, -3.2, 2.6), box(-10, -0.8, 20, 0, 2.6)];
  const { eye, area, count } = vantageOf(levelOf(walls), MIDDLE, DESK);
  assert.equal(count, 6);
  assert.ok(area.z > -3 && area.z < -1);
  assert.ok(!walls.some((wall) => hides(wall, eye, area)));
});

test("market stalls in front of the people stand beside the picture, and nobody is behind their awnings", () => {
  for (const [window, radius] of [[DESK, 2.8], [PHONE, 2.24]]) {
    for (const gap of [2.2, 3.4]) { // metres between two stalls
      const left = MIDDLE.x - gap / 2, right = MIDDLE.x + gap / 2, near = MIDDLE.z + 3;
      const stalls = [box(left - 2.4, near, left, near + 1.2, 2.2), box(right, near, right + 2.4, near + 1.2, 2.2)];
      const { eye, area } = vantageOf(levelOf(stalls), MIDDLE, window);
      for (let turn = 0; turn < 8; turn += 1) {
        const person = { x: area.x + radius * Math.sin(turn), z: area.z + radius * Math.cos(turn) };
        assert.ok(!stalls.some((stall) => hides(stall, eye, person)), `${gap} m, ${turn}`);
      }
    }
  }
});
