// three-vrm: agents on VRM 0 and VRM 1 avatars. For springs and constraints call `vrm.update(seconds)` after `pose`.

import { Character } from "./character.js";
import { WORDS } from "./core/bone_names.js";
import { THREE_NODES } from "./three.js";

/** @typedef {import("three").Object3D} Object3D */
/** @typedef {Pick<import("@pixiv/three-vrm").VRM, "scene" | "humanoid">} Avatar */

const NAMES = Object.values(WORDS.vrm).flat();

/**
 * A VRM avatar. It is posed by its normalized bones. The space around `vrm.scene` is the agents' world, whether the
 * scene was turned by `VRMUtils.rotateVRM0` or not.
 * @extends {Character<Object3D>}
 */
export class VrmCharacter extends Character {
  /**
   * @param {Avatar} vrm @param {ArrayLike<number>} restOffsets `played.agent.restOffsets`
   * @param {import("./character.js").CharacterOptions} [options]
   */
  constructor(vrm, restOffsets, options) {
    const { humanoid, scene } = vrm;
    /** @type {Map<string, Object3D>} */
    const bones = new Map();
    for (const name of NAMES) {
      const node = humanoid.getNormalizedBoneNode(/** @type {any} */ (name));
      if (node) bones.set(name, node);
    }
    const root = humanoid.normalizedHumanBonesRoot;
    /** @type {Map<Object3D, Object3D>} the normalized bone for each bone that moves skin */
    const raw = new Map();
    for (const [name, node] of bones) {
      const bone = humanoid.getRawBoneNode(/** @type {any} */ (name));
      if (bone) raw.set(bone, node);
    }
    const { mesh, skins, put, ...nodes } = THREE_NODES; // it stands in its T-pose
    super({
      ...nodes,
      children: (/** @type {Object3D} */ node) => (node === scene ? [root] : node.children),
      mesh: (tops, all) => {
        /** @type {Object3D[]} */
        const own = [];
        scene.traverse((/** @type {Object3D} */ node) => own.push(node));
        const found = /** @type {NonNullable<typeof mesh>} */ (mesh)(tops, own);
        const numbers = own.map((/** @type {Object3D} */ node) => {
          let above = /** @type {Object3D | null} */ (node);
          while (above && !raw.has(above)) above = above.parent;
          return above ? all.indexOf(/** @type {Object3D} */ (raw.get(above))) : -1;
        });
        return { places: found.places, nodes: found.nodes.map((node) => numbers[node] ?? -1) };
      },
    }, [scene], restOffsets, options, bones);
  }
}
