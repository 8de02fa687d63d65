import assert from "node:assert/strict";
import { test } from "node:test";
import { blockMeets, contains, Ground, planePoint } from "../../viewer/ground.js";

const at = (x, y, z) => ({ x, y, z });
const DOWN = { x: 0, y: -1, z: 0 };

/** A square of 8 m on the floor, a ramp up to 2 m at its +z side, and a gallery 3 m over the square. */
const GROUND = new Ground(
  [
    at(0, 0, 0), at(8, 0, 0), at(8, 0, 8), at(0, 0, 8),
    at(0, 2, 12), at(8, 2, 12),
    at(0, 3, 0), at(8, 3, 0), at(8, 3, 4), at(0, 3, 4),
  ],
  [[0, 1, 2], [0, 2, 3], [3, 2, 5], [3, 5, 4], [6, 7, 8], [6, 8, 9]],
);

test("the ground's height is that of the storey one is on", () => {
  assert.equal(GROUND.heightAt(2, 2, 0.4), 0);
  assert.equal(GROUND.heightAt(2, 2, 3.4), 3);
  assert.equal(GROUND.heightAt(2, 2, 2.7), 3); // a little under it
  assert.equal(GROUND.heightAt(2, 6, 3.4), 0);
  assert.ok(Math.abs(GROUND.heightAt(3, 10, 1) - 1) < 1e-9);
  assert.equal(GROUND.heightAt(-1, 2, 0), null);
  assert.equal(GROUND.heightAt(2, 2, -5), 0); // under all of it: the lowest
});

test("a ray meets what lies uppermost, and nothing beside the ground", () => {
  assert.deepEqual(GROUND.meets({ origin: at(2, 9, 2), direction: DOWN }), at(2, 3, 2));
  assert.equal(GROUND.meets({ origin: at(2, 9, 6), direction: DOWN }).y, 0);
  assert.equal(GROUND.meets({ origin: at(20, 9, 6), direction: DOWN }), null);
  assert.equal(GROUND.meets({ origin: at(2, 9, 2), direction: at(0, 1, 0) }), null);
});

test("a level plane is met only by looking towards it", () => {
  assert.deepEqual(planePoint({ origin: at(1, 4, 1), direction: at(0.6, -0.8, 0) }, 0), at(4, 0, 1));
  assert.equal(planePoint({ origin: at(1, 4, 1), direction: at(0, 1, 0) }), null);
  assert.equal(planePoint({ origin: at(1, 4, 1), direction: at(1, 0, 0) }), null);
});

const BLOCK = { top: [at(-1, 2, -1), at(1, 2, -1), at(1, 2, 1), at(-1, 2, 1)], bottom: 1 };

test("a block is met from above and from its sides, not past them", () => {
  assert.equal(blockMeets({ origin: at(0, 5, 0), direction: DOWN }, BLOCK), 3);
  const aside = (y) => blockMeets({ origin: at(-4, y, 0.2), direction: at(1, 0, 0) }, BLOCK);
  assert.ok(Math.abs(aside(1.5) - 3) < 1e-9);
  assert.equal(aside(0.5), Infinity); // under it
  assert.equal(aside(2.5), Infinity); // over it
  assert.equal(blockMeets({ origin: at(3, 5, 0), direction: DOWN }, BLOCK), Infinity);
});

test("a ring holds what is inside of it, corners cut in too", () => {
  const hook = [at(0, 0, 0), at(4, 0, 0), at(4, 0, 4), at(2, 0, 4), at(2, 0, 2), at(0, 0, 2)];
  assert.ok(contains(hook, { x: 1, z: 1 }));
  assert.ok(contains(hook, { x: 3, z: 3 }));
  assert.ok(!contains(hook, { x: 1, z: 3 }));
});
