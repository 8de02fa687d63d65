// Babylon.js: agents on characters of its glTF loader. Its bones follow the nodes that are written here.

import { Character } from "./character.js";

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
  move: ({ position }, place) => {
    position.set(place[0], place[1], place[2]);
  },
};

/**
 * A character below the loader's `__root__` (`container.rootNodes[0]`), or below a node of yours. Make it before
 * anything moves its bones, and stop its animation groups. What is below `__root__` is in glTF's axes, and that space
 * is the agents' world: leave `__root__` where it is. In a left-handed scene, x of the world is −x of the agents.
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
