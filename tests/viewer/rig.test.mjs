import assert from "node:assert/strict";
import { test } from "node:test";
import { Rig } from "../../service/wayfarer/transport/viewer/rig.js";

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const about = (axis, angle) => [0, 1, 2].map((k) => (k === axis ? Math.sin(angle / 2) : 0)).concat(Math.cos(angle / 2));

/** An inverse bind matrix that takes a joint at `place` to the origin. */
const from = ([x, y, z]) => [...IDENTITY.slice(0, 12), -x, -y, -z, 1];

const LEG = [
  { name: "hips", parent: -1, offset: [0, 1, 0], inverse: from([0, 1, 0]) },
  { name: "thigh", parent: 0, offset: [0.1, 0, 0], inverse: from([0.1, 1, 0]) },
  { name: "toe", parent: 1, offset: [0, -1, 0], inverse: from([0.1, 0, 0]) },
];

function moved(matrices, joint, [x, y, z]) {
  const m = matrices.subarray(16 * joint, 16 * joint + 16);
  return [0, 1, 2].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);
}

function close(found, wanted) {
  found.forEach((value, k) => assert.ok(Math.abs(value - wanted[k]) < 1e-6, `${found} is not ${wanted}`));
}

test("a pose moves the skin as its bones turn", () => {
  const rig = new Rig(LEG, ["hips", "thigh"]);
  const out = new Float32Array(16 * 4);
  const frame = Float32Array.from([5, 1, 2, 0, 0, 0, 1, ...about(0, Math.PI / 2)]);
  rig.matrices(frame, out, 16); // behind another body's matrices
  assert.deepEqual([...out.subarray(0, 16)], new Array(16).fill(0));
  const mine = out.subarray(16);
  close(moved(mine, 0, [0, 1, 0]), [5, 1, 2]); // hips where the frame says
  close(moved(mine, 1, [0.1, 0, 0]), [5.1, 1, 1]); // a leg turned about x: down becomes -z
  close(moved(mine, 2, [0.1, 0, 0.1]), [5.1, 0.9, 1]); // the toe, which no frame turns, goes with it
});

test("hips that turn take all with them", () => {
  const rig = new Rig(LEG, ["hips", "thigh"]);
  const out = new Float32Array(48);
  rig.matrices(Float32Array.from([0, 1, 0, ...about(1, Math.PI / 2), 0, 0, 0, 1]), out);
  close(moved(out, 2, [0.1, 0, 0]), [0, 0, -0.1]);
});

test("a body without a bone of the stream is refused", () => {
  assert.throws(() => new Rig(LEG, ["hips", "tail"]), /no bone tail/);
});
