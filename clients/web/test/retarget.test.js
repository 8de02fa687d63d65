import assert from "node:assert/strict";
import { test } from "node:test";
import { BASES, BONES, BoneMap, Retarget, Rig, headingOf, mapBones } from "../src/core/index.js";
import { golden } from "./golden.js";

const { walk, cases } = golden("retarget.json");
const { rest_offsets: OFFSETS, hips: HIPS, rotations: ROTATIONS } = walk.gltf;
const [OWN] = cases;

for (const { name, nodes, humanoid } of cases.filter(({ basis }) => basis === "gltf")) {
  test(`local rotations give the same places through the file's own nodes: ${name}`, () => {
    const bones = mapBones(new Rig(nodes), humanoid);
    const retarget = new Retarget(bones, OFFSETS.flat());
    HIPS.forEach((hips, k) => {
      retarget.pose([...hips, ...ROTATIONS[k].flat()]);
      const posed = nodes.map((node) => ({ ...node }));
      for (const b of retarget.mapped) posed[retarget.nodes[b]].rotation = retarget.local.slice(4 * b, 4 * b + 4);
      for (const b of retarget.loose) posed[retarget.nodes[b]].position = [...retarget.moved.subarray(3 * b, 3 * b + 3)];
      const rig = new Rig(posed);
      for (const b of retarget.mapped) {
        rig.place(retarget.nodes[b]).forEach((value, n) => (
          assert.ok(Math.abs(value - retarget.places[3 * b + n]) < 1e-6, `${BONES[b]} of frame ${k}`)));
      }
    });
  });
}

test("feet stand at a height that is given, also on stairs", () => {
  const retarget = new Retarget(mapBones(new Rig(OWN.nodes)), OFFSETS.flat());
  const [x, y, z] = HIPS[0];
  const places = (lift) => {
    retarget.pose([x, y + lift, z, ...ROTATIONS[0].flat()], lift);
    return [...retarget.places];
  };
  const ground = places(0);
  places(3).forEach((value, k) => assert.ok(Math.abs(value - ground[k] - (k % 3 === 1 ? 3 : 0)) < 1e-9));
});

test("a map can be shown and corrected", () => {
  const bones = mapBones(new Rig(OWN.nodes));
  assert.deepEqual([bones.table().left_knee, bones.missing], ["left_knee", []]);
  const other = bones.corrected({ spine2: null, neck: "head", head: null });
  assert.deepEqual([other.missing, other.foundBy, other.table().neck], [["spine2", "head"], "user", "head"]);
  assert.throws(() => bones.corrected({ head: "nose" }), /no node "nose"/);
  assert.throws(() => bones.corrected({ tail: "head" }), /"tail" is no bone/);
  assert.throws(() => bones.corrected({ left_knee: null }), /no node was found for left_knee, .*: knee: lowerleg, .*shin/);
  assert.throws(() => bones.corrected({ left_knee: "head", head: null }), /left_knee: "head" hangs from neck/);
  assert.throws(() => bones.corrected({ left_knee: "head" }), /left_knee: "head" is head, too/);
  assert.throws(() => bones.corrected({ spine3: "head", head: "spine3" }), /hangs from/);
  assert.ok(other instanceof BoneMap);
});

test("a map that failed is completed by corrections", () => {
  const rig = new Rig(OWN.nodes.map(({ name, parent }) => ({ name: name === "left_knee" ? "x" : name, parent }))); // nor by shape
  assert.throws(() => mapBones(rig), /no node was found for left_knee,/);
  const map = mapBones(rig, null, BASES.gltf, { left_knee: "x" });
  assert.equal(map.foundBy, "user");
  assert.deepEqual(map.missing, []);
});

test("what is no humanoid is refused in words", () => {
  const table = new Rig([
    { name: "table", parent: -1 }, { name: "leg1", parent: 0, position: [0, -1, 0] },
    { name: "leg2", parent: 0, position: [1, -1, 0] },
  ]);
  assert.throws(() => mapBones(table), /no node was found for pelvis, left_hip/);
  assert.throws(() => new Rig([{ name: "a", parent: 0 }]), /node 0 \(a\): its parent must stand before it/);
  assert.throws(() => new Retarget(mapBones(new Rig(OWN.nodes)), [1, 2, 3]), /rest offsets of 22 bones/);
});

test("a heading is 0 forwards, and grows as a turn about up does", () => {
  for (const [name, basis] of Object.entries(BASES)) {
    for (const angle of [0, 1, -2, 3]) {
      const turn = [...basis.up].map((value) => value * Math.sin(angle / 2));
      assert.ok(Math.abs(headingOf(basis, [9, ...turn, Math.cos(angle / 2)], 1) - angle) < 1e-6, name);
    }
  }
});
