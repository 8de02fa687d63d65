import assert from "node:assert/strict";
import { test } from "node:test";
import { isLevel } from "../../viewer/glb.js";

const PERSON = [{ mesh: 0, skin: 0 }, { children: [2] }, { children: [3] }, {}];
const SKINS = [{ joints: [1, 2] }];

test("a person is no level, also with a hat and a lantern on its bones", () => {
  assert.equal(isLevel({ nodes: PERSON, skins: SKINS }), false);
  const carrying = [{ mesh: 0, skin: 0 }, { children: [2, 4] }, { children: [3] }, { mesh: 1 }, { children: [5] }, { mesh: 2 }];
  assert.equal(isLevel({ nodes: carrying, skins: SKINS }), false);
});

test("a town with a passer-by or a flag in it is a level", () => {
  assert.equal(isLevel({ nodes: [...PERSON, { mesh: 1 }, { mesh: 2 }], skins: SKINS }), true);
});

test("an avatar is a character whatever else it has; what has no meshes is no level", () => {
  const town = [...PERSON, { mesh: 1 }, { mesh: 2 }];
  assert.equal(isLevel({ nodes: town, skins: SKINS, extensions: { VRMC_vrm: {} } }), false);
  assert.equal(isLevel({ nodes: [{}], skins: [] }), false);
  assert.equal(isLevel(null), false);
});
