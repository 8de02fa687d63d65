import assert from "node:assert/strict";
import { test } from "node:test";
import { Chase, turnTo } from "../../viewer/chase.js";

const WALKER = { x: 3, y: 1, z: -2, heading: 0 };

test("the camera is behind the person, above, and looks at it", () => {
  const { eye, target } = new Chase().advance(WALKER, 0.016);
  assert.ok(eye.z < WALKER.z - 3);
  assert.ok(Math.abs(eye.x - WALKER.x) < 1e-9);
  assert.ok(eye.y > target.y && target.y > WALKER.y);
});

test("a turn is followed little by little, the shorter way round", () => {
  const chase = new Chase();
  chase.advance({ ...WALKER, heading: 3 }, 0.016);
  let before = 3;
  for (let k = 0; k < 400; k += 1) {
    chase.advance({ ...WALKER, heading: -3 }, 0.016);
    assert.ok(turnTo(before, chase.heading) >= 0 && turnTo(before, chase.heading) < 0.02);
    before = chase.heading;
  }
  assert.ok(Math.abs(turnTo(chase.heading, -3)) < 0.01);
});

test("what stands between pushes the camera nearer, never through the person", () => {
  const near = (free) => {
    const { eye, target } = new Chase().advance(WALKER, 0.016, () => free);
    return Math.hypot(eye.x - target.x, eye.y - target.y, eye.z - target.z);
  };
  assert.ok(near(Infinity) > 3.5);
  assert.ok(Math.abs(near(2) - 1.65) < 1e-6);
  assert.ok(near(0.1) > 0.79);
});
