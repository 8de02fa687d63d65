import assert from "node:assert/strict";
import { test } from "node:test";
import { Bodies } from "../../viewer/bodies.js";

const BONES = ["hips", "head"];

/** A GLB of a body: `rows` triangles in a row along x, the last vertex on the head's joint, the others on the hips'. */
function glb(rows) {
  const places = Array.from({ length: rows }, (_, k) => [k, 0, 0, k, 1, 0, k + 1, 0, 0]).flat();
  const count = places.length / 3;
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const all = [
    [Float32Array.from([...identity, ...identity]), 2, "MAT4", 5126], [Float32Array.from(places), count, "VEC3", 5126],
    [Float32Array.from(places, (_, k) => Number(k % 3 === 2)), count, "VEC3", 5126],
    [Uint8Array.from({ length: 4 * count }, (_, k) => Number(k === 4 * count - 4)), count, "VEC4", 5121],
    [Float32Array.from({ length: 4 * count }, (_, k) => Number(k % 4 === 0)), count, "VEC4", 5126],
    [Uint32Array.from({ length: count }, (_, k) => k), count, "SCALAR", 5125],
  ];
  let at = 0;
  const bufferViews = all.map(([{ byteLength }]) => {
    at += byteLength;
    return { byteOffset: at - byteLength, byteLength };
  });
  const [POSITION, NORMAL, JOINTS_0, WEIGHTS_0] = [1, 2, 3, 4];
  const text = JSON.stringify({
    accessors: all.map(([, length, type, componentType], bufferView) => ({ bufferView, count: length, type, componentType })), bufferViews,
    nodes: [{ name: "hips", children: [1] }, { name: "head", translation: [0, 1, 0] }], skins: [{ joints: [0, 1], inverseBindMatrices: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION, NORMAL, JOINTS_0, WEIGHTS_0 }, indices: 5, material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { baseColorFactor: [1, 0.5, 0, 1] } }],
  });
  const json = new TextEncoder().encode(text.padEnd(4 * Math.ceil(text.length / 4)));
  const bytes = new Uint8Array(28 + json.length + at);
  const view = new DataView(bytes.buffer);
  [0x46546c67, 2, bytes.length, json.length, 0x4e4f534a].forEach((value, k) => view.setUint32(4 * k, value, true));
  bytes.set(json, 20);
  view.setUint32(20 + json.length, at, true);
  all.forEach(([{ buffer }], k) => bytes.set(new Uint8Array(buffer), 28 + json.length + bufferViews[k].byteOffset));
  return bytes.buffer;
}

/** Loads bodies of these numbers of triangles. */
async function load(bodies, ...rows) {
  globalThis.fetch = async (url) => new Response(glb(Number(url)));
  return Promise.all(rows.map((count) => bodies.load(() => [String(count), {}], BONES)));
}

/** The corners that are drawn, moved by their bones: [[x, y, z]], without triangles that have no size. */
function drawn(bodies) {
  return bodies.packs.flatMap(({ mesh: { geometry, skeleton } }) => {
    const { attributes: { position, skinIndex }, index, drawRange } = geometry;
    const corners = Array.from(index.array.subarray(0, drawRange.count), (vertex) => {
      const m = skeleton.boneMatrices.subarray(16 * skinIndex.getX(vertex));
      const [x, y, z] = [position.getX(vertex), position.getY(vertex), position.getZ(vertex)];
      return [0, 1, 2].map((row) => m[row] * x + m[4 + row] * y + m[8 + row] * z + m[12 + row]);
    });
    const triangles = Array.from({ length: corners.length / 3 }, (_, k) => corners.slice(3 * k, 3 * k + 3));
    return triangles.filter((triangle) => new Set(triangle.map(String)).size === 3);
  });
}

const at = (x, z) => Float32Array.from([x, 1, z, 0, 0, 0, 1, 0, 0, 0, 1]);

test("bodies of any size share meshes and one texture of bones, and each moves alone", async () => {
  const bodies = new Bodies();
  const all = await load(bodies, 2, 900, 40, 2);
  assert.deepEqual([bodies.packs.length, bodies.bones.length, bodies.group.children.length], [1, 1, 1]);
  assert.equal(drawn(bodies).length, 0); // nobody has a pose
  all.forEach(({ pose }, k) => pose(at(0, 10 * k)));
  assert.deepEqual([0, 10, 20, 30].map((z) => drawn(bodies).filter(([[, , place]]) => place === z).length), [2, 900, 40, 2]);
  const [, second] = drawn(bodies).filter(([[, , place]]) => place === 30);
  assert.deepEqual(second, [[1, 1, 30], [1, 2, 30], [2, 2, 30]]); // the last vertex hangs on the head, a metre above
  assert.equal(all[1].height, 1);
  all[1].hide();
  assert.equal(drawn(bodies).length, 44);
});

test("one who is gone leaves no triangle behind, and another takes the room", async () => {
  const bodies = new Bodies();
  const [first, second] = await load(bodies, 300, 300);
  first.pose(at(0, 0));
  second.pose(at(0, 10));
  first.remove();
  const [small] = await load(bodies, 2); // with the bones of the first
  small.pose(at(0, 20));
  assert.deepEqual(drawn(bodies).map(([[, , z]]) => z).sort(), [...Array(300).fill(10), 20, 20]);
  assert.equal(bodies.packs.length, 1);
});

test("hundreds are drawn by few meshes, and all keep their poses when room is made for more bones", async () => {
  const bodies = new Bodies();
  const many = await load(bodies, ...Array(120).fill(800)); // 2400 vertices each, as of a light body
  many.forEach(({ pose }, k) => pose(at(0, k)));
  const one = await load(bodies, ...Array(80).fill(2));
  one.forEach(({ pose }, k) => pose(at(0, 500 + k)));
  assert.ok(bodies.packs.length <= 4, `${bodies.packs.length} meshes`);
  assert.equal(new Set(bodies.packs.map(({ mesh }) => mesh.skeleton.boneTexture)).size, 1);
  const found = new Map();
  for (const [[, , z]] of drawn(bodies)) found.set(z, (found.get(z) ?? 0) + 1);
  assert.deepEqual([found.size, found.get(0), found.get(119), found.get(579)], [200, 800, 800, 2]);
});

test("a file that is missing or no body is refused in words", async () => {
  const bodies = new Bodies();
  globalThis.fetch = async () => new Response("", { status: 404 });
  await assert.rejects(bodies.load(() => ["x", {}], BONES), /HTTP 404/);
  globalThis.fetch = async () => new Response(new Uint8Array(40));
  await assert.rejects(bodies.load(() => ["x", {}], BONES), /no skin/);
});
