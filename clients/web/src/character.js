// A character of an engine: its nodes at rest, their map, and the poses written to them.

import { BASES, headingOf } from "./core/bases.js";
import { BoneMap, mapBones } from "./core/bone_map.js";
import { multiply, relative, rotate, rotateBack } from "./core/quaternions.js";
import { Retarget } from "./core/retarget.js";
import { Rig } from "./core/rig.js";
import { boundNodes } from "./core/skins.js";
import { measureSoles } from "./core/soles.js";

/** @typedef {import("./core/rig.js").Node} Node */
/**
 * How an engine's nodes are read and written.
 * @template T
 * @typedef {object} Engine
 * @property {(node: T) => Node} read its name and rest transform; `parent` is not looked at
 * @property {(node: T) => T[]} children the relevant ones
 * @property {(node: T, rotation: Float64Array, at: number) => void} turn set its rotation, x, y, z, w at `at`
 * @property {(node: T, place: Float64Array, at: number) => void} move set its place, x, y, z at `at`
 * @property {(node: T, rest: Node) => void} [put] set its whole transform
 * @property {(tops: T[], nodes: T[]) => import("./core/skins.js").Skin[]} [skins] below `tops`, in the space around them
 * @property {(tops: T[], nodes: T[]) => { places: number[], nodes: number[] }} [mesh] vertices in the present pose, in that
 *   space, and which of the nodes moves each most
 */
/**
 * `correct`: other nodes than those found, as in `BoneMap.corrected`. `floor`: height of its soles at rest, if it
 * differs from the lowest point of its mesh.
 * @typedef {object} CharacterOptions
 * @property {Record<string, string | null>} [correct] @property {number} [floor]
 */

/**
 * The nodes below `tops` as a rig, parents first, in the bind pose of their skin, whatever frame of an animation they
 * stood in; `table`: VRM's names → numbers of nodes. Arguments as for `Character`.
 * @template T @param {Engine<T>} engine @param {T[]} tops @param {Map<string, T>} [humanoid]
 */
export function readRig(engine, tops, humanoid = new Map()) {
  /** @type {Node[]} */
  const shown = [];
  /** @type {T[]} */
  const nodes = [];
  const collect = (/** @type {T} */ node, /** @type {number} */ parent) => {
    const number = shown.length;
    shown.push({ ...engine.read(node), parent });
    nodes.push(node);
    for (const child of engine.children(node)) collect(child, number);
  };
  for (const top of tops) collect(top, -1);
  const rest = boundNodes(shown, engine.put && engine.skins ? engine.skins(tops, nodes) : []);
  rest.forEach((node, k) => node !== shown[k] && engine.put?.(nodes[k], node));
  const table = Object.fromEntries([...humanoid].map(([name, node]) => [name, nodes.indexOf(node)]));
  return { rig: new Rig(rest), nodes, table };
}

/** A character posed by an agent's frames. @template T */
export class Character {
  #engine;
  #nodes;
  #carrier = -1; // the node above the hips that travels along, with everything else that hangs from it
  #carried = new Int32Array(); // loose bones that hang from it
  #scratch = new Float64Array(21);

  /**
   * `tops`: its uppermost nodes, as they stand at rest, in the stream's world: metres, glTF axes. `humanoid`: VRM's
   * names → nodes. Throws when it is no humanoid.
   * @param {Engine<T>} engine @param {T[]} tops @param {ArrayLike<number>} restOffsets of the agent
   * @param {CharacterOptions} [options] @param {Map<string, T>} [humanoid]
   */
  constructor(engine, tops, restOffsets, { correct = {}, floor } = {}, humanoid = new Map()) {
    this.#engine = engine;
    const { rig, nodes, table } = readRig(engine, tops, humanoid);
    this.#nodes = nodes;
    /** Which node is which bone. @type {BoneMap} */
    this.map = mapBones(rig, table, BASES.gltf, correct);
    const mesh = engine.mesh?.(tops, nodes) ?? { places: [], nodes: [] };
    /** Its soles, from its mesh. */
    this.soles = measureSoles(this.map, mesh.places, mesh.nodes);
    this.retarget = new Retarget(this.map, restOffsets, BASES.gltf, floor, this.soles);
    this.#findCarrier(mesh.nodes);
  }

  /**
   * The highest node below the uppermost ones that carries this skeleton and other skin or parts.
   * @param {number[]} movers of each vertex
   */
  #findCarrier(movers) {
    const { rig } = this.map, { nodes: bones, hangs, loose } = this.retarget;
    const hips = bones[0], line = rig.ancestors(hips), mapped = new Set([...bones].filter((node) => node >= 0));
    const held = new Set(movers.filter((node) => node >= 0 && ![node, ...rig.ancestors(node)].some((n) => mapped.has(n))));
    const carrier = line.slice(0, -1).reverse().find((node) => [...held].some((k) => k === node || rig.ancestors(k).includes(node)));
    if (carrier === undefined) return;
    this.#carrier = carrier;
    this.#carried = loose.filter((b) => hangs[b] < 0 && rig.ancestors(bones[b]).includes(carrier));
  }

  /** Places the carrier, and the bones that hang from it, relative to it. @param {Float32Array} frame */
  #carry(frame) {
    const { retarget } = this, { rig } = this.map, s = this.#scratch;
    const half = headingOf(BASES.gltf, frame, 3) / 2;
    s.set([0, Math.sin(half), 0, Math.cos(half)], 0);
    rotate(s, 0, retarget.origin, 0, s, 8);
    multiply(s, 0, retarget.turn, 0, s, 4); // how it has turned since rest, and where it was moved
    for (let n = 0; n < 3; n += 1) s[8 + n] = (n === 1 ? retarget.ground[0] : frame[n]) - s[8 + n];
    const node = this.#carrier, { parent } = rig.nodes[node];
    multiply(s, 4, rig.rotations, 4 * node, s, 11);
    rotate(s, 4, rig.places, 3 * node, s, 15);
    for (let n = 0; n < 3; n += 1) s[15 + n] += s[8 + n] - rig.places[3 * parent + n];
    relative(rig.rotations, 4 * parent, s, 11, s, 11);
    rotateBack(rig.rotations, 4 * parent, s, 15, s, 15);
    for (let n = 0; n < 3; n += 1) s[15 + n] /= rig.scales[3 * parent + n];
    this.#engine.turn(this.#nodes[node], s, 11);
    this.#engine.move(this.#nodes[node], s, 15);
    for (const b of this.#carried) {
      const above = rig.nodes[retarget.nodes[b]].parent;
      multiply(s, 4, rig.rotations, 4 * above, s, 11);
      relative(s, 11, retarget.rotations, 4 * b, retarget.local, 4 * b);
      for (let n = 0; n < 3; n += 1) s[18 + n] = retarget.places[3 * b + n] - s[8 + n];
      rotateBack(s, 4, s, 18, s, 18);
      for (let n = 0; n < 3; n += 1) s[18 + n] -= rig.places[3 * above + n];
      rotateBack(rig.rotations, 4 * above, s, 18, retarget.moved, 3 * b);
      for (let n = 0; n < 3; n += 1) retarget.moved[3 * b + n] /= rig.scales[3 * above + n];
    }
  }

  /**
   * Pose the character as an agent: `frame` is that of a `PlayedAgent`, of the profile `body` or `full`. `ground`:
   * height of the ground there; NaN: height of the lower sole. Allocates nothing.
   * @param {Float32Array} frame @param {number} [ground]
   */
  pose(frame, ground = NaN) {
    const { retarget } = this;
    retarget.pose(frame, ground);
    if (this.#carrier >= 0) this.#carry(frame);
    for (let n = 0; n < retarget.mapped.length; n += 1) {
      const bone = retarget.mapped[n];
      this.#engine.turn(this.#nodes[retarget.nodes[bone]], retarget.local, 4 * bone);
    }
    for (let n = 0; n < retarget.loose.length; n += 1) {
      const bone = retarget.loose[n];
      this.#engine.move(this.#nodes[retarget.nodes[bone]], retarget.moved, 3 * bone);
    }
  }
}
