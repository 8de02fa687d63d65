import assert from "node:assert/strict";
import { test } from "node:test";
import { posedJoints, Rig, settle } from "../../viewer/rig.js";

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

test("skin of a joint that no frame turns rests beside the joint above it, and moves with it", () => {
  const names = ["hips", "thigh"];
  const bent = LEG.map((joint) => (joint.name === "toe" ? { ...joint, inverse: [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, -0.1, 0, 0.2, 1] } : joint));
  const found = posedJoints(bent, names);
  assert.deepEqual(found.carriers, [0, 1, 1]);
  assert.deepEqual(found.posed.map(({ name }) => name), names);
  const skin = {
    position: Float32Array.from([0.3, 0.1, 0.2]), normal: Float32Array.from([0, 0, 1]),
    skinIndex: Uint16Array.from([2, 1, 0, 0]), skinWeight: Float32Array.from([0.75, 0.25, 0, 0]),
  };
  const [all, some] = [new Rig(bent, names), new Rig(found.posed, names)];
  const frame = Float32Array.from([5, 1, 2, ...about(1, 1), ...about(0, 0.7)]);
  const [before, after] = [new Float32Array(48), new Float32Array(32)];
  all.matrices(frame, before);
  some.matrices(frame, after);
  const [toe, thigh] = [2, 1].map((joint) => moved(before, joint, skin.position));
  settle(skin, found);
  assert.deepEqual([...skin.skinIndex.subarray(0, 2)], [1, 1]);
  close(moved(after, 1, skin.position), toe.map((value, axis) => 0.75 * value + 0.25 * thigh[axis]));
  close([...skin.normal], [0, -0.75, 0.25]);
});

test("a joint between two that turn stays, though no frame turns it", () => {
  const { posed, carriers } = posedJoints(LEG, ["hips", "toe"]);
  assert.deepEqual(posed.map(({ parent }) => parent), [-1, 0, 1]);
  assert.deepEqual(carriers, [0, 1, 2]);
});
