// Bones of a rig by its shape: clients/README.md, "Bones of a character".

import { cross, dot } from "./bases.js";
import { SIDES, joints, spreadSpine, words } from "./bones_by_name.js";

const LOW = 0.1; // of the rig's height: a branch that ends below this reaches the ground
const APART = 0.05; // of that height: least distance between the ends of two legs
const TOES = 0.02; // of that height: least distance of toes before the ankle
const FAR = 0.25; // of that height: least distance between two pairs of legs

/** @typedef {import("./rig.js").Rig} Rig */
/** @typedef {import("./bases.js").Basis} Basis */

/** Branches of a rig that reach the ground, and the bones that follow from them. */
export class Shape {
  /** @param {Rig} rig @param {Basis} basis */
  constructor(rig, basis) {
    this.rig = rig;
    this.basis = basis;
    this.height = rig.nodes.map((_, k) => dot(rig.place(k), basis.up));
    this.floor = Math.min(...this.height);
    this.tall = rig.nodes.length ? Math.max(...this.height) - this.floor : 0;
    /** Each node with all its descendants. */
    this.below = rig.nodes.map((_, k) => subtree(rig, k));
    /** The lowest of these, for each node. */
    this.lowest = this.below.map((nodes) => nodes.reduce((low, k) => (this.height[k] < this.height[low] ? k : low)));
    this.pairs = this.tall > 0 ? this.#pairs() : [];
  }

  /**
   * Nodes with two branches that reach the ground apart from each other; with the joints of both, three or more each.
   * @returns {{ above: number, chains: number[][] }[]}
   */
  #pairs() {
    const { rig, basis, tall } = this;
    /** @type {{ above: number, chains: number[][] }[]} */
    const found = [];
    rig.children.forEach((children, above) => {
      const feet = children.filter((child) => this.height[this.lowest[child]] < this.floor + LOW * tall);
      const chains = feet.map((foot) => joints(rig, path(rig, foot, this.lowest[foot]), 0.03 * tall));
      feet.forEach((_, a) => feet.slice(a + 1).forEach((__, n) => {
        const b = a + 1 + n;
        const gap = level(basis, minus(rig.place(this.lowest[feet[a]]), rig.place(this.lowest[feet[b]])));
        if (Math.min(chains[a].length, chains[b].length) >= 3 && Math.hypot(...gap) > APART * tall) {
          found.push({ above, chains: [chains[a], chains[b]] });
        }
      }));
    });
    return found;
  }

  /** Where the toes of a leg point, level. @param {number[]} chain */
  #toes(chain) {
    const last = chain[Math.min(3, chain.length - 1)];
    return level(this.basis, minus(this.rig.place(last), this.rig.place(chain[2])));
  }

  /**
   * A pair of legs of the same body that hangs far from these two thighs; null: none does.
   * @param {number} pelvis @param {number[]} hips
   */
  otherLegs(pelvis, hips) {
    const { rig } = this;
    const line = new Set([pelvis, ...rig.ancestors(pelvis), ...this.below[pelvis]]);
    const own = new Set(hips.flatMap((hip) => [hip, ...rig.ancestors(hip)]));
    const middle = (/** @type {number[]} */ [a, b]) => rig.place(a).map((value, n) => (value + rig.places[3 * b + n]) / 2);
    for (const { above, chains } of this.pairs) {
      const tops = chains.map(([top]) => top);
      if (!line.has(above) || tops.some((top) => own.has(top))) continue;
      if (Math.hypot(...level(this.basis, minus(middle(tops), middle(hips)))) > FAR * this.tall) return tops;
    }
    return null;
  }

  /** The bones that the shape reveals, enough for a humanoid or not. @returns {Map<string, number>} */
  bones() {
    const { rig, basis, tall } = this;
    const walking = this.pairs.filter(({ chains }) => chains.every((chain) => Math.hypot(...this.#toes(chain)) >= TOES * tall));
    const pair = walking.at(-1); // nodes come parents first: the deepest
    if (!pair) return new Map(); // no toes: nothing tells front from back, or a leg from a skirt
    const chains = [...pair.chains];
    const other = this.#toes(chains[1]);
    const forward = this.#toes(chains[0]).map((value, n) => value + other[n]);
    if (Math.hypot(...forward) < 0.01 * tall) return new Map();
    const aside = cross(basis.up, forward);
    const left = aside.map((value) => (basis.handed * value) / Math.hypot(...aside));
    if (dot(level(basis, minus(rig.place(chains[0][0]), rig.place(chains[1][0]))), left) < 0) chains.reverse();
    const bones = new Map([["pelvis", pair.above]]);
    SIDES.forEach((side, s) => ["hip", "knee", "ankle", "foot"].forEach((bone, k) => {
      if (chains[s][k] !== undefined) bones.set(`${side}_${bone}`, chains[s][k]);
    }));
    const top = this.below[pair.above].reduce((high, k) => (this.height[k] > this.height[high] ? k : high));
    return new Map([...bones, ...this.#upper(path(rig, pair.above, top).slice(1), left)]);
  }

  /**
   * The trunk's bones, by where arms branch off on both sides.
   * @param {number[]} spine @param {Float64Array} left @returns {[string, number][]}
   */
  #upper(spine, left) {
    const { rig, below, tall } = this;
    const side = rig.nodes.map((_, k) => dot(rig.place(k), left));
    for (const [k, chest] of spine.entries()) {
      const arms = rig.children[chest].filter((child) => !spine.includes(child));
      const reach = new Map(arms.map((arm) => [arm, below[arm].reduce((far, n) => (Math.abs(side[n]) > Math.abs(side[far]) ? n : far))]));
      const out = (/** @type {number} */ arm) => side[/** @type {number} */ (reach.get(arm))] - side[chest];
      const both = [arms.find((arm) => out(arm) > 0.15 * tall), arms.find((arm) => out(arm) < -0.15 * tall)];
      if (both.includes(undefined)) continue;
      const bones = spreadSpine(spine.slice(0, k + 1));
      SIDES.forEach((name, s) => {
        const arm = /** @type {number} */ (both[s]);
        const all = joints(rig, path(rig, arm, /** @type {number} */ (reach.get(arm))), 0.02 * tall);
        const hand = all.findIndex((node) => rig.children[node].length >= 3); // fingers begin
        const chain = hand < 0 ? all : all.slice(0, hand + 1);
        const names = ["collar", "shoulder", "elbow", "wrist"].slice(chain.length >= 4 ? 0 : 1);
        chain.slice(-4).slice(0, names.length).forEach((node, n) => bones.push([`${name}_${names[n]}`, node]));
      });
      const rest = joints(rig, spine.slice(k + 1), 0.01 * tall);
      if (rest.length === 1) return [...bones, ["head", rest[0]]];
      ["neck", "head"].forEach((bone, n) => rest[n] !== undefined && bones.push([bone, rest[n]]));
      return bones;
    }
    return spreadSpine(spine.slice(0, 1));
  }
}

/**
 * A node of a limb whose name gives the other side than its bone. "": none, or as many names agree with the side that
 * was found. @param {Rig} rig @param {Map<string, number>} bones
 */
export function contradicted(rig, bones) {
  let against = "", told = 0;
  for (const [bone, node] of bones) {
    const side = bone.split("_")[0], has = words(rig.nodes[node].name).side;
    if (!SIDES.includes(side) || !has) continue;
    told += has === side ? 1 : -1;
    if (has !== side) against ||= rig.nodes[node].name;
  }
  return told < 0 ? against : "";
}

/** @param {Basis} basis @param {Float64Array} v */
function level({ up }, v) {
  const high = dot(v, up);
  return v.map((value, n) => value - high * up[n]);
}

/** @param {Float64Array} a @param {Float64Array} b */
function minus(a, b) {
  return a.map((value, n) => value - b[n]);
}

/** A node and all its descendants. @param {Rig} rig @param {number} node */
export function subtree(rig, node) {
  const found = [node];
  for (const k of found) found.push(...rig.children[k]);
  return found;
}

/** @param {Rig} rig @param {number} top @param {number} bottom */
function path(rig, top, bottom) {
  const line = [bottom, ...rig.ancestors(bottom)];
  return line.slice(0, line.indexOf(top) + 1).reverse();
}
