// Babylon.js: agents on characters of its glTF loader. Its bones follow the nodes that are posed here.

import { Character } from "./character.js";
import { inverse, product } from "./core/skins.js";

/** @typedef {import("@babylonjs/core").TransformNode} TransformNode */

/** @type {import("./character.js").Engine<TransformNode>} */
const BABYLON_NODES = {
  read: ({ name, position, rotation, rotationQuaternion, scaling }) => {
    const { x, y, z, w } = rotationQuaternion ?? rotation.toQuaternion();
    return { name, parent: -1, position: position.asArray(), rotation: [x, y, z, w], scale: scaling.asArray() };
  },
  children: (node) => /** @type {TransformNode[]} */ (node.getChildren((child) => "rotationQuaternion" in child)),
  turn: (node, rotation, at) => {
    node.rotationQuaternion ??= node.rotation.toQuaternion();
    node.rotationQuaternion.set(rotation[at], rotation[at + 1], rotation[at + 2], rotation[at + 3]);
  },
  move: ({ position }, place, at) => {
    position.set(place[at], place[at + 1], place[at + 2]);
  },
  put: (node, { position = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] }) => {
    node.rotationQuaternion ??= node.rotation.toQuaternion();
    node.position.set(position[0], position[1], position[2]);
    node.rotationQuaternion.set(rotation[0], rotation[1], rotation[2], rotation[3]);
    node.scaling.set(scale[0], scale[1], scale[2]);
  },
  skins: (tops, nodes) => {
    /** @type {Map<any, import("./core/skins.js").Skin>} */
    const found = new Map();
    for (const { mesh, matrix } of meshesOf(tops)) {
      const { skeleton } = mesh;
      if (!skeleton) continue;
      /** @type {import("./core/skins.js").Skin} */
      const skin = found.get(skeleton) ?? {
        joints: skeleton.bones.map((/** @type {any} */ bone) => nodes.indexOf(bone.getTransformNode())),
        inverses: skeleton.bones.map((/** @type {any} */ bone) => bone.getAbsoluteInverseBindMatrix().asArray()),
        spaces: [],
      };
      skin.spaces.push(matrix);
      found.set(skeleton, skin);
    }
    return [...found.values()];
  },
  mesh: (tops, nodes) => {
    const numbers = new Map(nodes.map((node, k) => [node, k]));
    const owner = (/** @type {any} */ node) => {
      let found = node;
      while (found && !numbers.has(found)) found = found.parent;
      return found ? /** @type {number} */ (numbers.get(found)) : -1;
    };
    /** @type {number[]} */
    const places = [];
    /** @type {number[]} */
    const owners = [];
    for (const { mesh, matrix: m } of meshesOf(tops)) {
      mesh.skeleton?.prepare(true);
      const found = mesh.getPositionData(Boolean(mesh.skeleton), false);
      if (!found) continue;
      const which = mesh.getVerticesData("matricesIndices"), weights = mesh.getVerticesData("matricesWeights");
      const bones = mesh.skeleton?.bones.map((/** @type {any} */ bone) => owner(bone.getTransformNode()));
      const own = owner(mesh);
      for (let k = 0; k < found.length / 3; k += 1) {
        const [x, y, z] = [found[3 * k], found[3 * k + 1], found[3 * k + 2]];
        for (let n = 0; n < 3; n += 1) places.push(m[n] * x + m[4 + n] * y + m[8 + n] * z + m[12 + n]);
        let most = 0;
        for (let n = 1; weights && n < 4; n += 1) if (weights[4 * k + n] > weights[4 * k + most]) most = n;
        owners.push(bones && which ? bones[which[4 * k + most]] : own);
      }
    }
    return { places, nodes: owners };
  },
};

/**
 * Meshes below some nodes, each with the matrix (16 numbers, by columns) from its own space into the space around the
 * nodes. @param {TransformNode[]} tops @returns {{ mesh: any, matrix: Float64Array }[]}
 */
function meshesOf(tops) {
  return tops.flatMap((top) => {
    const above = /** @type {TransformNode | null} */ (top.parent);
    const back = inverse(above ? above.computeWorldMatrix(true).asArray() : [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
    const found = [top, ...top.getChildMeshes(false)].filter((/** @type {any} */ node) => node.getPositionData);
    return found.map((mesh) => ({ mesh, matrix: product(back, mesh.computeWorldMatrix(true).asArray()) }));
  });
}

/**
 * A character below the loader's `__root__` (`container.rootNodes[0]`), or below a node of yours. Stop its animation
 * groups. Below `__root__`, axes are glTF's, and that space is the agents' world: leave `__root__` where it is. In a
 * left-handed scene, x of the world is −x of the agents.
 * @extends {Character<TransformNode>}
 */
export class BabylonCharacter extends Character {
  /**
   * @param {TransformNode} root @param {ArrayLike<number>} restOffsets `played.agent.restOffsets`
   * @param {import("./character.js").CharacterOptions} [options]
   */
  constructor(root, restOffsets, options) {
    super(BABYLON_NODES, root.name === "__root__" ? BABYLON_NODES.children(root) : [root], restOffsets, options);
  }
}
