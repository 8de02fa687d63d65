// Characters of three.js, three-vrm and Babylon.js stand where the golden traces say: the engines' own places are read.

import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { test } from "node:test";
import { golden } from "./golden.js";

const { walk, cases } = golden("retarget.json");
const { rest_offsets: OFFSETS, hips: HIPS, rotations: ROTATIONS } = walk.gltf;
const skip = existsSync(new URL("../node_modules/three", import.meta.url)) ? false : "needs the engines: npm ci";
const { ENGINES } = skip ? { ENGINES: { three: null, vrm: null, babylon: null } } : await import("./engines.js");

function check({ nodes, map, poses }, { character, settle, place }) {
  const number = new Map(nodes.map(({ name }, k) => [name, k]));
  HIPS.forEach((hips, k) => {
    character.pose(Float32Array.from([...hips, ...ROTATIONS[k].flat()]));
    settle();
    for (const [bone, wanted] of Object.entries(poses[k].places)) {
      const off = Math.hypot(...place(number.get(map[bone])).map((value, n) => value - wanted[n]));
      assert.ok(off < 1e-3, `${bone} of frame ${k} is ${off} m off`);
    }
  });
}

for (const [engine, make] of Object.entries(ENGINES)) {
  for (const found of cases.filter(({ basis, humanoid }) => basis === "gltf" && (engine !== "vrm" || humanoid))) {
    // without its table, the vrm0 rig has names that say nothing: it is told by its shape
    test(`${engine}: ${found.name}`, { skip }, () => {
      const rig = make(found.nodes, found.humanoid, OFFSETS.flat());
      if (engine === "vrm" || !found.humanoid) check(found, rig);
      else assert.ok(["names", "shape"].includes(rig.character.map.foundBy));
    });
  }
}

test("vrm: an avatar of VRM 0 that was turned round walks the same way", { skip }, () => {
  const found = cases.find(({ name }) => name === "vrm0");
  check(found, ENGINES.vrm(found.nodes, found.humanoid, OFFSETS.flat(), true));
});

test("three: names that GLTFLoader has changed, meshes called as bones, corrections", { skip }, async () => {
  const { Bone, Group, Mesh } = await import("three");
  const { ThreeCharacter } = await import("../src/three.js");
  const { nodes } = cases.find(({ name }) => name === "mixamo");
  const root = new Group();
  const head = new Mesh();
  head.name = "Head";
  root.add(head);
  const made = nodes.map(({ name, position }) => {
    const bone = new Bone();
    bone.name = name.replace(":", "");
    bone.userData.name = name;
    bone.position.fromArray(position);
    return bone;
  });
  nodes.forEach(({ parent }, k) => (parent < 0 ? root : made[parent]).add(made[k]));
  const { map } = new ThreeCharacter(root, OFFSETS.flat(), { correct: { neck: null } });
  assert.equal(map.table().head, "mixamorig:Head");
  assert.deepEqual([map.foundBy, map.missing], ["user", ["neck"]]);
});
