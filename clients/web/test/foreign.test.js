// Rigs that others made (tests/golden/foreign_rigs.json): no bone is missing.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Rig, mapBones } from "../src/core/index.js";
import { golden } from "./golden.js";

const HALF = Math.SQRT1_2;

for (const [name, bones] of Object.entries(golden("foreign_rigs.json").rigs)) {
  test(name, () => {
    const nodes = bones.map(([bone, parent, head]) => ({
      name: bone,
      parent: parent + 1,
      position: head.map((value, n) => value - (parent < 0 ? 0 : bones[parent][2][n])),
    }));
    const map = mapBones(new Rig([{ name: "Armature", parent: -1, rotation: [-HALF, 0, 0, HALF] }, ...nodes]));
    assert.deepEqual([map.foundBy, map.missing], ["names", []]);
  });
}
