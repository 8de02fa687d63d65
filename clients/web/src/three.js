// three.js: agents on characters that GLTFLoader, FBXLoader … have loaded. No AnimationMixer is needed.

import { Character } from "./character.js";

/** @typedef {import("three").Object3D} Object3D */

/** @type {import("./character.js").Engine<Object3D>} */
export const THREE_NODES = {
  read: ({ name, userData, position, quaternion, scale }) => ({
    name: nameOf({ name, userData }),
    parent: -1,
    position: position.toArray(),
    rotation: [quaternion.x, quaternion.y, quaternion.z, quaternion.w],
    scale: scale.toArray(),
  }),
  children: ({ children }) => children.filter(holdsBones),
  turn: ({ quaternion }, rotation, at) => {
    quaternion.set(rotation[at], rotation[at + 1], rotation[at + 2], rotation[at + 3]);
  },
  move: ({ position }, place, at) => {
    position.set(place[at], place[at + 1], place[at + 2]);
  },
  put: (node, { position = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1] }) => {
    node.position.set(position[0], position[1], position[2]);
    node.quaternion.set(rotation[0], rotation[1], rotation[2], rotation[3]);
    node.scale.set(scale[0], scale[1], scale[2]);
  },
  skins: skinsOf,
  mesh: meshOf,
};

/**
 * A character whose skeleton is below `root`. The space around `root` is the agents' world: put it into the scene
 * itself, or into a group that stands for their world.
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

/**
 * Meshes below some nodes, each with the matrix from its own space into the space around the nodes.
 * @param {Object3D[]} tops @returns {{ mesh: any, matrix: import("three").Matrix4 }[]}
 */
function meshesOf(tops) {
  return tops.flatMap((top) => {
    top.updateWorldMatrix(true, false);
    top.updateMatrixWorld(true); // skinned meshes take their matrices here
    const back = top.matrixWorld.clone().identity();
    if (top.parent) back.copy(top.parent.matrixWorld).invert();
    /** @type {{ mesh: any, matrix: import("three").Matrix4 }[]} */
    const found = [];
    top.traverse((/** @type {any} */ mesh) => {
      if (mesh.isMesh) found.push({ mesh, matrix: back.clone().multiply(mesh.matrixWorld) });
    });
    return found;
  });
}

/** @param {Object3D[]} tops @param {Object3D[]} nodes @returns {import("./core/skins.js").Skin[]} */
function skinsOf(tops, nodes) {
  /** @type {Map<any, import("./core/skins.js").Skin>} */
  const found = new Map();
  for (const { mesh, matrix } of meshesOf(tops)) {
    if (!mesh.isSkinnedMesh) continue;
    const { bones, boneInverses } = mesh.skeleton;
    /** @type {import("./core/skins.js").Skin} */
    const skin = found.get(mesh.skeleton) ?? {
      joints: bones.map((/** @type {Object3D} */ bone) => nodes.indexOf(bone)),
      inverses: boneInverses.map((/** @type {import("three").Matrix4} */ inverse) => inverse.elements),
      spaces: [],
    };
    skin.spaces.push(matrix.elements);
    found.set(mesh.skeleton, skin);
  }
  return [...found.values()];
}

/** @param {Object3D[]} tops @param {Object3D[]} nodes */
function meshOf(tops, nodes) {
  const numbers = new Map(nodes.map((node, k) => [node, k]));
  const owner = (/** @type {Object3D | null} */ node) => {
    let found = node;
    while (found && !numbers.has(found)) found = found.parent;
    return found ? /** @type {number} */ (numbers.get(found)) : -1;
  };
  /** @type {number[]} */
  const places = [];
  /** @type {number[]} */
  const owners = [];
  for (const { mesh, matrix } of meshesOf(tops)) {
    const { position, skinIndex, skinWeight } = mesh.geometry.attributes;
    if (!position) continue;
    const bones = mesh.isSkinnedMesh ? mesh.skeleton.bones.map(owner) : [];
    const own = owner(mesh), place = mesh.position.clone();
    for (let vertex = 0; vertex < position.count; vertex += 1) {
      let most = 0;
      for (let k = 1; mesh.isSkinnedMesh && k < 4; k += 1) {
        if (skinWeight.getComponent(vertex, k) > skinWeight.getComponent(vertex, most)) most = k;
      }
      mesh.getVertexPosition(vertex, place).applyMatrix4(matrix);
      places.push(place.x, place.y, place.z);
      owners.push(mesh.isSkinnedMesh ? bones[skinIndex.getComponent(vertex, most)] : own);
    }
  }
  return { places, nodes: owners };
}

/** A node's name as in the file: GLTFLoader removes dots and colons. @param {{ name: string, userData: any }} node @returns {string} */
function nameOf({ name, userData }) {
  return userData?.name ?? name;
}

/** Whether a node is or carries bones: a mesh may be called "head", too. @param {Object3D} node @returns {boolean} */
function holdsBones(node) {
  return /** @type {any} */ (node).isBone === true || node.children.some(holdsBones);
}
