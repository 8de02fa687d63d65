// A character of an engine: its nodes at rest, their map, and the poses that are written to them.

import { BASES } from "./core/bases.js";
import { BoneMap, mapBones } from "./core/bone_map.js";
import { Retarget } from "./core/retarget.js";
import { Rig } from "./core/rig.js";

/**
 * How an engine's nodes are read and written.
 * @template T
 * @typedef {object} Engine
 * @property {(node: T) => import("./core/rig.js").Node} read its name and rest transform; `parent` is not looked at
 * @property {(node: T) => T[]} children those that matter
 * @property {(node: T, rotation: Float64Array, at: number) => void} turn give it a rotation: x, y, z, w at `at`
 * @property {(node: T, place: Float64Array) => void} move give it a place
 */
/**
 * `correct`: other nodes than those found, as in `BoneMap.corrected`. `floor`: height of its soles at rest, where they
 * are not at 0 and it wears high heels, say.
 * @typedef {object} CharacterOptions
 * @property {Record<string, string | null>} [correct] @property {number} [floor]
 */

/** A character that is posed by an agent's frames. @template T */
export class Character {
  #engine;
  /** @type {T[]} */
  #nodes = [];

  /**
   * `tops`: its uppermost nodes, as they stand at rest, in the stream's world: metres, glTF axes. `humanoid`: VRM's
   * names → nodes. Throws when it is no humanoid.
   * @param {Engine<T>} engine @param {T[]} tops @param {ArrayLike<number>} restOffsets of the agent
   * @param {CharacterOptions} [options] @param {Map<string, T>} [humanoid]
   */
  constructor(engine, tops, restOffsets, { correct = {}, floor = NaN } = {}, humanoid = new Map()) {
    this.#engine = engine;
    /** @type {import("./core/rig.js").Node[]} */
    const rest = [];
    const collect = (/** @type {T} */ node, /** @type {number} */ parent) => {
      const number = rest.length;
      rest.push({ ...engine.read(node), parent });
      this.#nodes.push(node);
      for (const child of engine.children(node)) collect(child, number);
    };
    for (const top of tops) collect(top, -1);
    const table = Object.fromEntries([...humanoid].map(([name, node]) => [name, this.#nodes.indexOf(node)]));
    const found = mapBones(new Rig(rest), table);
    /** Which node is which bone. @type {BoneMap} */
    this.map = Object.keys(correct).length ? found.corrected(correct) : found;
    this.retarget = new Retarget(this.map, restOffsets, BASES.gltf, floor);
  }

  /**
   * Stand as an agent does: `frame` is a `PlayedAgent`'s, of the profile `body` or `full`. `ground`: height of the
   * ground there; NaN: that of the lower sole. Allocates nothing.
   * @param {Float32Array} frame @param {number} [ground]
   */
  pose(frame, ground = NaN) {
    const { retarget } = this;
    retarget.pose(frame, ground);
    for (let n = 0; n < retarget.mapped.length; n += 1) {
      const bone = retarget.mapped[n];
      this.#engine.turn(this.#nodes[retarget.nodes[bone]], retarget.local, 4 * bone);
    }
    this.#engine.move(this.#nodes[retarget.nodes[0]], retarget.hips);
  }
}
