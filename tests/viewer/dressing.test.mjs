import assert from "node:assert/strict";
import { test } from "node:test";
import { crownHides, crownOf, dressingOf } from "../../viewer/dressing.js";

const ring = (corners, radius, y) => Array.from({ length: corners }, (_, k) => (
  { x: 5 + radius * Math.cos((2 * Math.PI * k) / corners), y, z: -3 + radius * Math.sin((2 * Math.PI * k) / corners) }
));
const box = (wide, deep, y) => [[0, 0], [wide, 0], [wide, deep], [0, deep]].map(([x, z]) => ({ x, y, z }));

test("only what is as large as a house or a tree is dressed", () => {
  for (const block of [
    { top: box(1, 1, 0.9), bottom: 0 }, // a crate
    { top: box(24, 0.15, 2.6), bottom: 0 }, { top: box(0.5, 9, 9), bottom: 0 }, // walls
    { top: box(2, 2, 1.5), bottom: 0 }, { top: ring(24, 0.8, 1.8), bottom: 0 }, { top: box(0.3, 1.6, 0.4), bottom: 0 }, // a step
    { top: [...box(2.4, 1.2, 2.2).slice(0, 3), { x: 0, y: 2, z: 1.2 }], bottom: 0 }, // its top is not level
  ]) {
    assert.deepEqual(dressingOf(block, 1), { walls: true, triangles: [] });
    assert.equal(crownOf(block), null);
  }
});

test("a house has windows before all its walls, one door in each, and a roof over it", () => {
  const { walls, triangles } = dressingOf({ top: box(12, 10, 9), bottom: 0 }, 0);
  assert.equal(walls, true);
  const lit = new Set(triangles.filter(({ glow }) => glow).map(({ colour }) => colour));
  assert.deepEqual([...lit], ["#46545f"]); // some windows, no door
  const colours = [...new Set(triangles.map(({ colour }) => colour))];
  const count = (colour) => triangles.filter((one) => one.colour === colour).length / 2;
  assert.equal(colours.length, 4);
  const bays = 2 * (Math.floor(12 / 2.7) + Math.floor(10 / 2.7));
  assert.deepEqual(colours.map(count), [3 * bays, 3 * bays - 4, 4, 2]); // frames, windows, doors, roof
  for (const { corners: [a, b, c], normals: [normal] } of triangles) {
    const u = { x: b.x - a.x, y: b.y - a.y, z: b.z - a.z }, v = { x: c.x - a.x, y: c.y - a.y, z: c.z - a.z };
    const across = { x: u.y * v.z - u.z * v.y, y: u.z * v.x - u.x * v.z, z: u.x * v.y - u.y * v.x };
    assert.ok(across.x * normal.x + across.y * normal.y + across.z * normal.z > 0); // seen from outside
    assert.ok(Math.abs(Math.hypot(normal.x, normal.y, normal.z) - 1) < 1e-9);
    const middle = { x: (a.x + b.x + c.x) / 3 - 6, z: (a.z + b.z + c.z) / 3 - 5 };
    assert.ok(middle.x * normal.x + middle.z * normal.z > 0);
    assert.ok([a, b, c].every(({ y }) => y >= 0));
  }
});

test("a tree has a crown over people's heads, which hides what is behind it and who is in it", () => {
  const tree = { top: ring(24, 0.25, 5), bottom: 0 };
  const crown = crownOf(tree);
  assert.ok(Math.hypot(crown.x - 5, crown.z + 3) < 1e-9);
  const ys = dressingOf(tree, 2).triangles.flatMap(({ corners }) => corners.map(({ y }) => y));
  assert.ok(Math.min(...ys) > 2.5 && Math.max(...ys) < 8);
  const eye = { x: 5, y: 9, z: 9 };
  assert.equal(crownHides(crown, eye, { x: 5, y: 2, z: -12 }), true);
  assert.equal(crownHides(crown, eye, { x: 5, y: 1, z: 3 }), false); // before it
  assert.equal(crownHides(crown, { x: 5, y: 5, z: -0.5 }, { x: 5, y: 1, z: 9 }), true); // the eye is in it
  assert.equal(crownHides(crown, { x: 5, y: 5, z: 1 }, { x: 5, y: 1, z: 9 }), false);
});

test("fountain, column, stall and bench stand in the place of their blocks, closed and seen from outside", () => {
  for (const [top, over, high, lamps] of [
    [ring(24, 3, 0.8), 0, 1.91, 0], [ring(24, 0.5, 3), 0, 3.01, 0], [box(1.2, 2.4, 2.2), 0.31, 2.61, 1], [box(1.8, 0.5, 0.5), 0, 3.49, 1],
  ]) {
    const { walls, triangles } = dressingOf({ top, bottom: 0 }, 2);
    assert.equal(walls, false);
    assert.equal(triangles.some(({ glow }) => glow > 0), Boolean(lamps));
    const [xs, zs] = ["x", "z"].map((axis) => top.map((point) => point[axis]));
    for (const { corners, normals } of triangles) {
      for (const { x, y, z } of corners) {
        assert.ok(y > -1e-9 && y < high);
        assert.ok(x > Math.min(...xs) - over - 0.02 && x < Math.max(...xs) + over + 0.02); // people pass where the block is not
        assert.ok(z > Math.min(...zs) - over - 0.02 && z < Math.max(...zs) + over + 0.02);
      }
      const [u, v] = [1, 2].map((k) => ["x", "y", "z"].map((axis) => corners[k][axis] - corners[0][axis]));
      const across = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      assert.ok(Math.hypot(...across) > 1e-6);
      for (const normal of normals) {
        assert.ok(Math.abs(Math.hypot(normal.x, normal.y, normal.z) - 1) < 1e-9);
        assert.ok(across[0] * normal.x + across[1] * normal.y + across[2] * normal.z > 0);
      }
    }
  }
});

test("every second bench has a lamp", () => {
  const shines = (number) => dressingOf({ top: box(1.8, 0.5, 0.5), bottom: 0 }, number).triangles.some(({ glow }) => glow > 0);
  assert.deepEqual([0, 1, 2, 3].map(shines), [true, false, true, false]);
});
