// three.js: agents on characters that GLTFLoader, FBXLoader … have loaded. No AnimationMixer is needed.

import { Character } from "./character.js";

/** @typedef {import("three").Object3D} Object3D */

/** @type {import("./character.js").Engine<Object3D>} */
export const THREE_NODES = {
  read: ({ name, userData, position, quaternion, scale }) => ({
    name: userData?.name ?? name, // GLTFLoader takes dots and colons out of names, and keeps them here
    parent: -1,
    position: position.toArray(),
    rotation: [quaternion.x, quaternion.y, quaternion.z, quaternion.w],
    scale: scale.toArray(),
  }),
  children: ({ children }) => children.filter(holdsBones),
  turn: ({ quaternion }, rotation, at) => {
    quaternion.set(rotation[at], rotation[at + 1], rotation[at + 2], rotation[at + 3]);
  },
  move: ({ position }, place) => {
    position.set(place[0], place[1], place[2]);
  },
};

/**
 * A character whose skeleton is below `root`. Make it before anything moves its bones. The space around `root` is the
 * agents' world: put it into the scene itself, or into a group that stands for their world.
 * @extends {Character<Object3D>}
 */
export class ThreeCharacter extends Character {
  /**
   * @param {Object3D} root @param {ArrayLike<number>} restOffsets `played.agent.restOffsets`
   * @param {import("./character.js").CharacterOptions} [options]
   */
  constructor(root, restOffsets, options) {
    super(THREE_NODES, [root], restOffsets, options);
  }
}

/** Bones, and what they hang from: a mesh may be called "head", too. @param {Object3D} node @returns {boolean} */
function holdsBones(node) {
  return /** @type {any} */ (node).isBone === true || node.children.some(holdsBones);
}
