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
 * are not at 0 and it wears high heels, say. `foot`: as for `Retarget`.
 * @typedef {object} CharacterOptions
 * @property {Record<string, string | null>} [correct] @property {number} [floor]
 * @property {{ heel: number, tip: number }} [foot]
 */

/**
 * The nodes below `tops` as a rig, parents first; `table`: VRM's names → numbers of nodes. As for `Character`.
 * @template T @param {Engine<T>} engine @param {T[]} tops @param {Map<string, T>} [humanoid]
 */
export function readRig(engine, tops, humanoid = new Map()) {
  /** @type {import("./core/rig.js").Node[]} */
  const rest = [];
  /** @type {T[]} */
  const nodes = [];
  const collect = (/** @type {T} */ node, /** @type {number} */ parent) => {
    const number = rest.length;
    rest.push({ ...engine.read(node), parent });
    nodes.push(node);
    for (const child of engine.children(node)) collect(child, number);
  };
  for (const top of tops) collect(top, -1);
  const table = Object.fromEntries([...humanoid].map(([name, node]) => [name, nodes.indexOf(node)]));
  return { rig: new Rig(rest), nodes, table };
}

/** A character that is posed by an agent's frames. @template T */
export class Character {
  #engine;
  #nodes;

  /**
   * `tops`: its uppermost nodes, as they stand at rest, in the stream's world: metres, glTF axes. `humanoid`: VRM's
   * names → nodes. Throws when it is no humanoid.
   * @param {Engine<T>} engine @param {T[]} tops @param {ArrayLike<number>} restOffsets of the agent
   * @param {CharacterOptions} [options] @param {Map<string, T>} [humanoid]
   */
  constructor(engine, tops, restOffsets, { correct = {}, floor, foot } = {}, humanoid = new Map()) {
    this.#engine = engine;
    const { rig, nodes, table } = readRig(engine, tops, humanoid);
    this.#nodes = nodes;
    /** Which node is which bone. @type {BoneMap} */
    this.map = mapBones(rig, table, BASES.gltf, correct);
    this.retarget = new Retarget(this.map, restOffsets, BASES.gltf, floor, foot);
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
