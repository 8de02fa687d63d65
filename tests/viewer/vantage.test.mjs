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
    base: 0, ground, heightAt: (x, z) => ground.heightAt(x, z) ?? 0,
    freeAlong: (ray) => Math.min(Infinity, ...blocks.map((block) => blockMeets(ray, block))),
  };
}

const MIDDLE = { x: 5, z: -2 };

test("on free ground people walk in the middle, and are seen from near, also on a phone that is held upright", () => {
  for (const tall of [false, true]) {
    const { eye, target, area, count } = vantageOf(levelOf([]), MIDDLE, tall);
    assert.deepEqual(area, { ...MIDDLE, radius: tall ? 0.8 * 2.8 : 2.8 });
    assert.equal(count, 10);
    assert.ok(Math.hypot(eye.x - target.x, eye.y - target.y, eye.z - target.z) < 13);
  }
});

test("people walk before what stands in the middle, and it is seen behind them", () => {
  const { eye, target, area } = vantageOf(levelOf([box(2, -5, 8, 1, 0.8)]), MIDDLE, false);
  const out = Math.hypot(area.x - MIDDLE.x, area.z - MIDDLE.z);
  assert.ok(out > 3 && out < 7);
  assert.ok(Math.hypot(eye.x - MIDDLE.x, eye.z - MIDDLE.z) > out + 5);
  assert.ok(Math.hypot(target.x - MIDDLE.x, target.z - MIDDLE.z) < out);
});

test("in a corridor fewer people come, and are seen along it or over its walls", () => {
  const walls = [box(-10, -4, 20, -3.2, 2.6), box(-10, -0.8, 20, 0, 2.6)];
  const { eye, area, count } = vantageOf(levelOf(walls), MIDDLE, false);
  assert.equal(count, 6);
  assert.ok(area.z > -3 && area.z < -1);
  const way = { x: area.x - eye.x, y: 1 - eye.y, z: area.z - eye.z }, reach = Math.hypot(way.x, way.y, way.z);
  const direction = { x: way.x / reach, y: way.y / reach, z: way.z / reach };
  assert.ok(walls.every((wall) => blockMeets({ origin: eye, direction }, wall) >= reach));
});
