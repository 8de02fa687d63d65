import assert from "node:assert/strict";
import { test } from "node:test";
import { blockMesh, extentOf, outlineOf } from "../../viewer/shapes.js";

const at = (x, y, z) => ({ x, y, z });
const fan = (ring) => ring.slice(2).map((_, k) => [0, k + 1, k + 2]);
const SQUARE = [at(2, 1, 3), at(4, 1, 3), at(4, 1, 5), at(2, 1, 5)];
const RAMP = [at(0, 0, 0), at(2, 0, 0), at(2, 1, 4), at(0, 1, 4)];

/** The triangles of a mesh: [{ corners, normal }]. */
function trianglesOf({ corners, normals }) {
  return Array.from({ length: corners.length / 9 }, (_, t) => ({
    corners: [0, 1, 2].map((k) => [...corners.slice(9 * t + 3 * k, 9 * t + 3 * k + 3)]),
    normal: [...normals.slice(9 * t, 9 * t + 3)],
  }));
}

const minus = (a, b) => a.map((value, k) => value - b[k]);
const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];

test("a block is closed but for its underside, its faces outward, whichever way its outline runs", () => {
  for (const top of [SQUARE, [...SQUARE].reverse()]) {
    const triangles = trianglesOf(blockMesh([{ top, bottom: 0 }], fan));
    assert.equal(triangles.length, 2 + 2 * 4);
    for (const { corners: [a, b, c], normal } of triangles) {
      assert.ok(dot(cross(minus(b, a), minus(c, a)), normal) > 0, "wound against its normal");
      assert.ok(dot(minus(a, [3, 0.5, 4]), normal) > 0, "faces inward");
    }
  }
});

test("a ramp keeps its slope", () => {
  const [{ normal }] = trianglesOf(blockMesh([{ top: RAMP, bottom: 0 }], fan));
  assert.ok(Math.abs(normal[2] / normal[1] + 0.25) < 1e-6); // 1 m in 4 m, falling to -z
});

test("blocks can be told apart in the mesh they share; round ones have no lines down their sides", () => {
  const round = Array.from({ length: 24 }, (_, k) => at(Math.cos(k * Math.PI / 12), 1, Math.sin(k * Math.PI / 12)));
  const mesh = blockMesh([{ top: SQUARE, bottom: 0 }, { top: round, bottom: 0 }], fan);
  assert.deepEqual(mesh.starts, [0, 30, 30 + 3 * (22 + 48)]);
  assert.equal(mesh.corners.length, 3 * mesh.starts.at(-1));
  assert.equal(mesh.lines.length / 6, 4 + 4 + 24);
  assert.deepEqual(blockMesh([], fan).starts, [0]);
});

test("tall blocks of one height do not lie in one plane", () => {
  const tall = SQUARE.map((point) => ({ ...point, y: 9 }));
  const { corners } = blockMesh([{ top: tall, bottom: 0 }, { top: tall, bottom: 0 }], fan);
  const heights = new Set(corners.filter((_, k) => k % 3 === 1 && corners[k] > 8));
  assert.equal(heights.size, 2);
});

test("an outline leaves out the edges within", () => {
  const lines = outlineOf(SQUARE, [[0, 1, 2], [0, 2, 3]]);
  assert.equal(lines.length / 6, 4);
});

test("an extent holds all points", () => {
  assert.deepEqual(extentOf([...SQUARE, ...RAMP]), { x: 2, z: 2.5, low: 0, high: 1, size: 5 });
});
