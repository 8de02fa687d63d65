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
    // without its table, the vrm0 rig has names that say nothing, so its shape decides
    test(`${engine}: ${found.name}`, { skip }, () => {
      const rig = make(found.nodes, found.humanoid, OFFSETS.flat(), found.mesh);
      if (engine === "vrm" || !found.humanoid) check(found, rig);
      else assert.ok(["names", "shape"].includes(rig.character.map.foundBy));
    });
  }
}

test("vrm: an avatar of VRM 0 that was turned round walks the same way", { skip }, () => {
  const found = cases.find(({ name }) => name === "vrm0");
  check(found, ENGINES.vrm(found.nodes, found.humanoid, OFFSETS.flat(), null, true));
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

test("three: rest is what the skin was bound to, and what hangs from the root travels along", { skip }, async () => {
  const { Bone, Euler, Group, Mesh, BoxGeometry, Skeleton, SkinnedMesh, BufferGeometry, Float32BufferAttribute, Uint16BufferAttribute, Vector3 } = await import("three");
  const { ThreeCharacter } = await import("../src/three.js");
  const { nodes, poses } = cases.find(({ name }) => name === "mixamo");
  const make = (posed) => {
    const root = new Group();
    const made = nodes.map(({ name, position, rotation }) => {
      const bone = new Bone();
      bone.name = name;
      bone.position.fromArray(position);
      bone.quaternion.fromArray(rotation);
      return bone;
    });
    nodes.forEach(({ parent }, k) => (parent < 0 ? root : made[parent]).add(made[k]));
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute([0, 1, 0], 3));
    geometry.setAttribute("skinIndex", new Uint16BufferAttribute([1, 0, 0, 0], 4));
    geometry.setAttribute("skinWeight", new Float32BufferAttribute([1, 0, 0, 0], 4));
    const mesh = new SkinnedMesh(geometry);
    root.add(mesh);
    root.updateMatrixWorld(true);
    mesh.bind(new Skeleton(made), mesh.matrixWorld);
    const lantern = new Mesh(new BoxGeometry(0.1, 0.1, 0.1));
    lantern.position.set(0.4, 0, 0);
    made[0].add(lantern); // the armature, above the hips
    if (posed) {
      for (const [k, bone] of made.entries()) if (k > 0) bone.quaternion.setFromEuler(new Euler(0.1 * k, 0.3, -0.2));
      made[1].position.y = 0.4;
    }
    return { root, made, lantern, character: new ThreeCharacter(root, OFFSETS.flat()) };
  };
  const [plain, posed] = [make(false), make(true)];
  HIPS.forEach((hips, k) => {
    for (const { character, root } of [plain, posed]) {
      character.pose(Float32Array.from([...hips, ...ROTATIONS[k].flat()]));
      root.updateMatrixWorld(true);
    }
    nodes.forEach((_, n) => {
      const [a, b] = [plain, posed].map(({ made }) => made[n].getWorldPosition(new Vector3()));
      assert.ok(a.distanceTo(b) < 1e-3, `${nodes[n].name} of frame ${k}`);
    });
    const at = plain.lantern.getWorldPosition(new Vector3());
    assert.ok(Math.abs(Math.hypot(at.x - hips[0], at.z - hips[2]) - 0.4) < 1e-3 && Math.abs(at.y) < 0.1, `lantern at ${at.toArray()}`);
    const wanted = poses[k].places.pelvis;
    const found = plain.made[1].getWorldPosition(new Vector3()).toArray();
    assert.ok(Math.hypot(...found.map((value, n) => value - wanted[n])) < 1e-3, `hips of frame ${k}`);
  });
});
