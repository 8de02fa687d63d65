// Bones of a rig by the words of its nodes' names: clients/README.md, "Bones of a character". The words are in
// bone_names.js.

import { WORDS } from "./bone_names.js";

export const SIDES = ["left", "right"];
const SPINE = ["spine1", "spine2", "spine3"];
const BREAKS = /(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])/g;
const TOKENS = /[A-Za-z]+|[^\u0000-\u007f]+/g;
const MARKS = { left: WORDS.left, right: WORDS.right };
/** Pairs of a role and the role of the bone that it hangs from. @type {[keyof typeof WORDS.roles, string][]} */
const LIMBS = [
  ["hip", ""], ["knee", "hip"], ["ankle", "knee"], ["foot", "ankle"],
  ["shoulder", ""], ["elbow", "shoulder"], ["wrist", "elbow"], ["collar", ""],
];

/** @typedef {import("./rig.js").Rig} Rig */

/** Side ("left", "right", "") and the rest of a name; both "" for helpers. @param {string} name */
export function words(name) {
  const last = /** @type {string} */ (name.split(/[:|]/).at(-1));
  const tokens = (last.replace(BREAKS, " ").match(TOKENS) ?? []).map((token) => token.toLowerCase());
  if (tokens.some((token) => WORDS.helpers.includes(token))) return { side: "", rest: "" };
  let side = "";
  const rest = [];
  for (let token of tokens) {
    for (const [which, marks] of Object.entries(MARKS)) {
      const mark = marks.find((word) => token === word || begins(token, word));
      if (mark) [side, token] = [which, token.slice(mark.length)];
    }
    if (!WORDS.noise.includes(token)) rest.push(token);
  }
  return { side, rest: rest.join("") };
}

/** Whether a word in a script without spaces begins with its side. @param {string} token @param {string} mark */
function begins(token, mark) {
  return mark > "\u007f" && token.startsWith(mark);
}

/**
 * Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3.
 * @param {number[]} chain @returns {[string, number][]}
 */
export function spreadSpine(chain) {
  const count = chain.length;
  if (count === 0) return [];
  if (count === 1) return [["spine3", chain[0]]];
  if (count === 2) return [["spine1", chain[0]], ["spine3", chain[1]]];
  return SPINE.map((bone, k) => [bone, chain[Math.floor((k * (count - 1) + 1) / 2)]]);
}

/** Bones by VRM's table: its names → nodes. @param {Record<string, number>} humanoid @returns {Map<string, number>} */
export function byVrm(humanoid) {
  const { spine, ...table } = WORDS.vrm;
  const bones = new Map(Object.entries(table).flatMap(([bone, name]) => (
    name in humanoid ? [/** @type {[string, number]} */ ([bone, humanoid[name]])] : []
  )));
  const chain = spine.filter((name) => name in humanoid).map((name) => humanoid[name]);
  return new Map([...bones, ...spreadSpine(chain)]);
}

/** The bones that names reveal, enough for a humanoid or not. @param {Rig} rig @returns {Map<string, number>} */
export function byNames(rig) {
  return new Names(rig).bones;
}

class Names {
  /** @param {Rig} rig */
  constructor(rig) {
    this.rig = rig;
    this.words = rig.nodes.map(({ name }) => words(name));
    this.above = rig.nodes.map((_, k) => rig.ancestors(k));
    /** @type {Map<string, number>} */
    this.bones = new Map();
    this.taken = new Set();
    for (const side of SIDES) {
      for (const [role, upper] of LIMBS) this.find(`${side}_${role}`, role, side, this.bones.get(`${side}_${upper}`));
    }
    this.find("neck", "neck");
    this.find("head", "head", "", this.bones.get("neck"));
    this.find("pelvis", "pelvis");
    this.findPelvis();
    this.findSpine();
  }

  /**
   * The uppermost node with the first of the role's words that any node has. Nodes below `inside` come first. Otherwise
   * it may be anywhere: feet of IK rigs hang from the root. A word of two roles, such as `foot`, is not looked for
   * there again.
   * @param {string} bone @param {keyof typeof WORDS.roles} role @param {string} [side] @param {number} [inside]
   */
  find(bone, role, side = "", inside = undefined) {
    for (const within of inside === undefined ? [undefined] : [inside, undefined]) {
      for (const word of WORDS.roles[role]) {
        if (within === undefined && inside !== undefined && role === "foot" && word === "foot") continue;
        const found = this.words.flatMap(({ side: has, rest }, k) => (
          rest === word && has === side && !this.taken.has(k) && (within === undefined || this.above[k].includes(within)) ? [k] : []
        ));
        if (!found.length) continue;
        const first = found.reduce((best, k) => (this.above[k].length < this.above[best].length ? k : best));
        this.bones.set(bone, first);
        this.taken.add(first);
        return;
      }
    }
  }

  /** The nodes at the end of the trunk: the neck, or the head, or both arms. @returns {number[]} */
  get top() {
    const one = this.bones.get("neck") ?? this.bones.get("head");
    if (one !== undefined) return [one];
    const arms = SIDES.map((side) => this.bones.get(`${side}_collar`) ?? this.bones.get(`${side}_shoulder`));
    return arms.every((arm) => arm !== undefined) ? /** @type {number[]} */ (arms) : [];
  }

  /** Both thighs, as far as they were found. @returns {number[]} */
  get legs() {
    return SIDES.flatMap((side) => this.bones.get(`${side}_hip`) ?? []);
  }

  /** Moves the pelvis to the lowest node that carries both legs and the trunk. */
  findPelvis() {
    const { legs } = this;
    if (legs.length < 2) return;
    for (const carried of [[...legs, ...this.top], legs]) {
      const shared = this.shared(carried);
      if (shared.includes(this.bones.get("pelvis") ?? -1)) return;
      if (shared.length) {
        this.bones.set("pelvis", shared[0]);
        return;
      }
    }
  }

  /** The common ancestors of these nodes, from below. @param {number[]} nodes */
  shared(nodes) {
    return this.above[nodes[0]].filter((k) => nodes.every((n) => this.above[n].includes(k)));
  }

  /**
   * The trunk's bones, from which no thigh hangs. Where rigs only number them, with neck and head, as Rigify does,
   * where arms branch off tells them apart.
   */
  findSpine() {
    const { top, rig, words: named } = this;
    const pelvis = this.bones.get("pelvis");
    if (!top.length || pelvis === undefined) return;
    if (top.length === 1) return this.#add(spreadSpine(this.trunk(top[0])));
    const [chest] = this.shared(top);
    if (chest === undefined || !this.above[chest].includes(pelvis)) return;
    const chain = [];
    const onward = (/** @type {number} */ node) => rig.children[node].filter((k) => named[k].rest && !named[k].side);
    for (let next = onward(chest); next.length === 1; next = onward(next[0])) chain.push(next[0]);
    this.#add(spreadSpine([...this.trunk(chest), chest]));
    const extent = [0, 1, 2].map((n) => {
      const values = rig.nodes.map((_, k) => rig.places[3 * k + n]);
      return Math.max(...values) - Math.min(...values);
    });
    const rest = joints(rig, chain, 0.01 * Math.max(...extent));
    if (rest.length > 1) this.bones.set("neck", rest[0]);
    if (rest.length) this.bones.set("head", /** @type {number} */ (rest.at(-1)));
  }

  /** Named nodes below this one, from the lowest, except ancestors of thighs. @param {number} top */
  trunk(top) {
    const found = [];
    for (const k of this.above[top]) {
      if (this.legs.some((leg) => this.above[leg].includes(k))) break;
      if (this.words[k].rest && !this.words[k].side) found.push(k);
    }
    return found.reverse();
  }

  /** @param {[string, number][]} found */
  #add(found) {
    for (const [bone, node] of found) this.bones.set(bone, node);
  }
}

/** The nodes of a path, without those nearer than `least` to the one kept before. @param {Rig} rig @param {number[]}
line @param {number} least */
export function joints(rig, line, least) {
  /** @type {number[]} */
  const found = [];
  for (const k of line) {
    const last = found.at(-1);
    if (last === undefined || Math.hypot(...rig.place(k).map((value, n) => value - rig.places[3 * last + n])) >= least) found.push(k);
  }
  return found;
}
