// three.js: agents on characters that GLTFLoader, FBXLoader … have loaded. No AnimationMixer is needed.

import { Character } from "./character.js";
import { words } from "./core/bone_map.js";
import { WORDS } from "./core/bone_names.js";

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

/**
 * Make one tree of the bones that move skin, where a file has them in several, as Rigify's rigs do whose deforming bones
 * hang from control bones or from nothing: upper arms go to their collar bones, others to the nearest bone of the trunk.
 * Returns those bones. Call it at rest, before a character is made.
 * @param {Object3D} root @returns {Set<Object3D>}
 */
export function joinSkeleton(root) {
  root.updateMatrixWorld(true);
  const bones = deforming(root);
  const above = (/** @type {Object3D} */ bone) => {
    let found = bone.parent;
    while (found && !bones.has(found)) found = found.parent;
    return found;
  };
  const tops = [...bones].filter((bone) => !above(bone));
  if (tops.length < 2) return bones;
  const place = (/** @type {Object3D} */ { matrixWorld: { elements } }) => [elements[12], elements[13], elements[14]];
  const trunkOf = (/** @type {Object3D} */ top) => {
    /** @type {Object3D[]} */
    const found = [];
    top.traverse((node) => {
      const { side, rest } = words(nameOf(node));
      if (bones.has(node) && rest && !side) found.push(node);
    });
    return found;
  };
  const trunk = tops.map(trunkOf).reduce((best, found) => (found.length > best.length ? found : best));
  if (!trunk.length) return bones;
  const gap = (/** @type {Object3D} */ bone, /** @type {Object3D} */ part) => {
    const from = place(part);
    const ends = part.children.filter((child) => trunk.includes(child)).map(place);
    return Math.min(...[from, ...ends].map((end) => toSegment(place(bone), from, end)));
  };
  for (const bone of tops) {
    if (trunk.some((part) => part === bone || ancestorOf(bone, part))) continue;
    const { side, rest } = words(nameOf(bone));
    const arm = WORDS.roles.shoulder.includes(rest) && !WORDS.roles.collar.includes(rest);
    const collar = arm ? tops.find((other) => {
      const has = words(nameOf(other));
      return has.side === side && WORDS.roles.collar.includes(has.rest);
    }) : undefined;
    (collar ?? trunk.reduce((best, part) => (gap(bone, part) < gap(bone, best) ? part : best))).attach(bone);
  }
  return bones;
}

/**
 * What the mesh of a character at rest tells of its feet, for the options `floor` and `foot`; {} where its bones do not.
 * `map`: of a rig read from `root`; `nodes`: its nodes (`readRig`).
 * @param {Object3D} root @param {import("./core/bone_map.js").BoneMap} map @param {Object3D[]} nodes
 * @returns {{ floor?: number, foot?: { heel: number, tip: number } }}
 */
export function measureFeet(root, { rig, bones }, nodes) {
  root.updateMatrixWorld(true);
  const feet = ["left", "right"].flatMap((side) => {
    const ankle = bones.get(`${side}_ankle`), ball = bones.get(`${side}_foot`);
    if (ankle === undefined || ball === undefined) return [];
    const [from, to] = [rig.place(ankle), rig.place(ball)];
    const length = Math.hypot(to[0] - from[0], to[2] - from[2]);
    const below = new Set(nodes.filter((_, k) => k === ankle || rig.ancestors(k).includes(ankle)));
    const foot = { low: Infinity, heel: -Infinity, tip: -Infinity };
    eachVertex(root, below, ({ x, y, z }) => {
      const along = ((x - from[0]) * (to[0] - from[0]) + (z - from[2]) * (to[2] - from[2])) / length;
      foot.low = Math.min(foot.low, y);
      foot.heel = Math.max(foot.heel, -along / length);
      foot.tip = Math.max(foot.tip, along / length - 1);
    });
    return length > 0 && foot.heel > 0.1 && foot.heel < 1 && foot.tip > 0.1 && foot.tip < 1.5 ? [foot] : [];
  });
  if (feet.length < 2) return {};
  const mean = (/** @type {"heel" | "tip"} */ part) => (feet[0][part] + feet[1][part]) / 2;
  return { floor: Math.min(feet[0].low, feet[1].low), foot: { heel: mean("heel"), tip: mean("tip") } };
}

/** Tell the place of each vertex that is moved by some bones above all. @param {Object3D} root @param {Set<Object3D>} bones @param {(place: import("three").Vector3) => void} tell */
function eachVertex(root, bones, tell) {
  const place = root.position.clone();
  root.traverse((/** @type {any} */ mesh) => {
    if (!mesh.isSkinnedMesh) return;
    const { skinIndex, skinWeight } = mesh.geometry.attributes;
    for (let vertex = 0; vertex < skinIndex.count; vertex += 1) {
      let most = 0;
      for (let k = 1; k < 4; k += 1) if (skinWeight.getComponent(vertex, k) > skinWeight.getComponent(vertex, most)) most = k;
      if (!bones.has(mesh.skeleton.bones[skinIndex.getComponent(vertex, most)])) continue;
      mesh.getVertexPosition(vertex, place);
      tell(place.applyMatrix4(mesh.matrixWorld));
    }
  });
}

/** @param {Object3D} upper @param {Object3D} lower */
function ancestorOf(upper, lower) {
  for (let node = lower.parent; node; node = node.parent) if (node === upper) return true;
  return false;
}

/** As in the file: GLTFLoader takes dots and colons out of names. @param {{ name: string, userData: any }} node @returns {string} */
function nameOf({ name, userData }) {
  return userData?.name ?? name;
}

/** The bones that have a weight in some skin, and those between them. @param {Object3D} root @returns {Set<Object3D>} */
function deforming(root) {
  /** @type {Set<Object3D>} */
  const found = new Set();
  root.traverse((/** @type {any} */ { isSkinnedMesh, skeleton, geometry }) => {
    if (!isSkinnedMesh) return;
    const { skinIndex, skinWeight } = geometry.attributes;
    for (let vertex = 0; vertex < skinIndex.count; vertex += 1) {
      for (let k = 0; k < 4; k += 1) {
        if (skinWeight.getComponent(vertex, k) > 0) found.add(skeleton.bones[skinIndex.getComponent(vertex, k)]);
      }
    }
  });
  for (const bone of [...found]) {
    /** @type {Object3D[]} */
    const between = [];
    for (let node = bone.parent; node; node = node.parent) {
      if (found.has(node)) {
        for (const passed of between) found.add(passed);
        break;
      }
      between.push(node);
    }
  }
  return found;
}

/** The way from a point to a stretch. @param {number[]} p @param {number[]} a @param {number[]} b */
function toSegment(p, a, b) {
  const along = a.map((value, n) => b[n] - value);
  const squared = along.reduce((sum, value) => sum + value * value, 0);
  const share = squared && Math.min(1, Math.max(0, along.reduce((sum, value, n) => sum + value * (p[n] - a[n]), 0) / squared));
  return Math.hypot(...p.map((value, n) => value - a[n] - share * along[n]));
}

/** Bones, and what they hang from: a mesh may be called "head", too. @param {Object3D} node @returns {boolean} */
function holdsBones(node) {
  return /** @type {any} */ (node).isBone === true || node.children.some(holdsBones);
}
