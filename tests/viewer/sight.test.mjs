import assert from "node:assert/strict";
import { test } from "node:test";
import { RINGS, viewpoints } from "../../viewer/sight.js";

test("the camera sees, and all of who is selected comes wherever he is", () => {
  const camera = { x: 1.04, y: 2.5, z: -3.96 };
  assert.deepEqual(viewpoints(camera, []), [{ position: { x: 1, y: 2.5, z: -4 } }]);
  const chosen = { shown: true, x: 30, y: 0, z: 4 };
  assert.deepEqual(viewpoints(camera, [chosen])[1], { position: { x: 30, y: 1, z: 4 } });
  assert.equal(viewpoints(camera, [{ ...chosen, shown: false }]).length, 1);
  assert.equal(viewpoints(camera, Array(20).fill(chosen)).length, 8);
});

test("rings are in order, and the last holds everybody", () => {
  assert.deepEqual(RINGS.map(({ radius }) => radius), [15, 45, 20000]);
});
