// Which node of a rig is which bone: by VRM's table, else by names, else by shape. clients/README.md, "Bones of a
// character". Words of names are in bone_names.js.

import { BASES, cross, dot } from "./bases.js";
import { WORDS } from "./bone_names.js";
import { BONES } from "./rig.js";

const SIDES = ["left", "right"];
const REQUIRED = ["pelvis", ...SIDES.flatMap((side) => ["hip", "knee", "ankle"].map((bone) => `${side}_${bone}`))];
const SPINE = ["spine1", "spine2", "spine3"];
const BREAKS = /(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])/g;

/** @typedef {import("./rig.js").Rig} Rig */
/** @typedef {import("./bases.js").Basis} Basis */

/** A rig that is no humanoid as it is mapped; the message says what is wrong, and what is allowed. */
export class BoneMapError extends Error {
  /** @param {string} message @param {Map<string, number>} bones */
  constructor(message, bones) {
    super(message);
    this.name = "BoneMapError";
    /** Bones that were found, by canonical name. @type {Map<string, number>} */
    this.bones = bones;
  }
}

/** A rig's nodes by canonical bone name, and how they were found. */
export class BoneMap {
  /** @param {Rig} rig @param {Map<string, number>} bones @param {"vrm" | "names" | "shape" | "user"} foundBy */
  constructor(rig, bones, foundBy) {
    this.rig = rig;
    this.bones = checked(rig, bones);
    this.foundBy = foundBy;
  }

  /** Bones that the rig lacks; their turns go on into their children. */
  get missing() {
    return BONES.filter((bone) => !this.bones.has(bone));
  }

  /** Canonical name → name of the node: to show it, or keep it. @returns {Record<string, string>} */
  table() {
    return Object.fromEntries([...this.bones].map(([bone, node]) => [bone, this.rig.nodes[node].name]));
  }

  /**
   * With other nodes for some bones (by node name), or without them (null). Throws when that is no humanoid.
   * @param {Record<string, string | null>} changes
   */
  corrected(changes) {
    return new BoneMap(this.rig, changed(this.rig, this.bones, changes), "user");
  }
}

/** @param {Rig} rig @param {Map<string, number>} found @param {Record<string, string | null>} changes */
function changed(rig, found, changes) {
  const names = rig.nodes.map(({ name }) => name);
  const bones = new Map(found);
  for (const [bone, name] of Object.entries(changes)) {
    if (!BONES.includes(bone)) throw new BoneMapError(`"${bone}" is no bone; bones are ${BONES.join(", ")}`, found);
    bones.delete(bone);
    if (name === null) continue;
    if (!names.includes(name)) throw new BoneMapError(`${bone}: the rig has no node "${name}"`, found);
    bones.set(bone, names.indexOf(name));
  }
  return bones;
}

/**
 * The map of a rig. `humanoid`: VRM's names → nodes; `basis`: of the rig's space, for its up; `correct`: as in
 * `corrected`, also where too little is found. Throws BoneMapError.
 * @param {Rig} rig @param {Record<string, number> | null} [humanoid] @param {Basis} [basis]
 * @param {Record<string, string | null>} [correct]
 */
export function mapBones(rig, humanoid = null, basis = BASES.gltf, correct = {}) {
  const [found, foundBy] = find(rig, humanoid, basis);
  if (Object.keys(correct).length) return new BoneMap(rig, changed(rig, found, correct), "user");
  return new BoneMap(rig, found, foundBy);
}

/**
 * @param {Rig} rig @param {Record<string, number> | null} humanoid @param {Basis} basis
 * @returns {[Map<string, number>, "vrm" | "names" | "shape"]}
 */
function find(rig, humanoid, basis) {
  if (humanoid && Object.keys(humanoid).length) return [byVrm(humanoid), "vrm"];
  const named = byNames(rig);
  if (REQUIRED.every((bone) => named.has(bone))) return [named, "names"];
  const shaped = byShape(rig, basis);
  if (REQUIRED.every((bone) => shaped.has(bone))) return [shaped, "shape"];
  return [named, "names"];
}

/** What is said of bones that were not found. @param {string[]} lacking */
function unknown(lacking) {
  const roles = /** @type {(keyof typeof WORDS.roles)[]} */ ([...new Set(lacking.map((bone) => bone.replace(/^(left|right)_/, "")))]);
  const allowed = roles.map((role) => `${role}: ${WORDS.roles[role].join(", ")}`).join("; ");
  return `no node was found for ${lacking.join(", ")}. Known names, with sides as in LeftFoot, foot_l, foot.L: ${allowed}`;
}

/** The bones in canonical order, if they are those of a humanoid. @param {Rig} rig @param {Map<string, number>} bones */
function checked(rig, bones) {
  const node = (/** @type {string} */ bone) => /** @type {number} */ (bones.get(bone));
  const lacking = REQUIRED.filter((bone) => !bones.has(bone));
  if (lacking.length) throw new BoneMapError(unknown(lacking), bones);
  const hangs = (/** @type {string} */ lower, /** @type {string} */ upper) => {
    if (rig.ancestors(node(lower)).includes(node(upper))) return;
    throw new BoneMapError(`${lower}: "${rig.nodes[node(lower)].name}" does not hang from the ${upper}`, bones);
  };
  for (const side of SIDES) {
    hangs(`${side}_hip`, "pelvis");
    hangs(`${side}_knee`, `${side}_hip`);
    hangs(`${side}_ankle`, `${side}_knee`);
  }
  const found = new Map(BONES.filter((bone) => bones.has(bone)).map((bone) => [bone, node(bone)]));
  const nodes = new Map([...found].map(([bone, k]) => [k, bone]));
  for (const [bone, k] of found) {
    const above = rig.ancestors(k).find((n) => nodes.has(n));
    const name = above === undefined ? undefined : nodes.get(above);
    const right = bone === "pelvis" ? name === undefined : name && BONES.indexOf(name) < BONES.indexOf(bone);
    if (!right) throw new BoneMapError(`${bone}: "${rig.nodes[k].name}" hangs from ${name ?? "no bone"}`, bones);
  }
  return found;
}

/**
 * Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3.
 * @param {number[]} chain @returns {[string, number][]}
 */
function spreadSpine(chain) {
  const count = chain.length;
  if (count === 0) return [];
  if (count === 1) return [["spine3", chain[0]]];
  if (count === 2) return [["spine1", chain[0]], ["spine3", chain[1]]];
  return SPINE.map((bone, k) => [bone, chain[Math.floor((k * (count - 1) + 1) / 2)]]);
}

/** @param {Record<string, number>} humanoid @returns {Map<string, number>} */
function byVrm(humanoid) {
  const { spine, ...table } = WORDS.vrm;
  const bones = new Map(Object.entries(table).flatMap(([bone, name]) => (
    name in humanoid ? [/** @type {[string, number]} */ ([bone, humanoid[name]])] : []
  )));
  const chain = spine.filter((name) => name in humanoid).map((name) => humanoid[name]);
  return new Map([...bones, ...spreadSpine(chain)]);
}

/** Side ("left", "right", "") and the rest of a name; helpers give nothing. @param {string} name */
export function words(name) {
  const last = /** @type {string} */ (name.split(/[:|]/).at(-1));
  const tokens = last.replace(BREAKS, " ").split(/[^A-Za-z]+/).filter(Boolean).map((token) => token.toLowerCase());
  if (tokens.some((token) => WORDS.helpers.includes(token))) return { side: "", rest: "" };
  let side = "";
  const rest = [];
  for (const token of tokens) {
    if (WORDS.left.includes(token)) side = "left";
    else if (WORDS.right.includes(token)) side = "right";
    else if (!WORDS.noise.includes(token)) rest.push(token);
  }
  return { side, rest: rest.join("") };
}

/** @param {Rig} rig @returns {Map<string, number>} */
function byNames(rig) {
  const named = rig.nodes.map(({ name }) => words(name));
  const above = rig.nodes.map((_, k) => rig.ancestors(k));
  /** @type {Map<string, number>} */
  const bones = new Map();
  const taken = new Set();
  const find = (/** @type {string} */ bone, /** @type {keyof typeof WORDS.roles} */ role, side = "", inside = -1) => {
    for (const word of WORDS.roles[role]) {
      const found = named.flatMap(({ side: has, rest }, k) => (
        rest === word && has === side && !taken.has(k) && (inside < 0 || above[k].includes(inside)) ? [k] : []
      ));
      if (!found.length) continue;
      const first = found.reduce((best, k) => (above[k].length < above[best].length ? k : best));
      bones.set(bone, first);
      taken.add(first);
      return;
    }
  };
  /** @type {[keyof typeof WORDS.roles, string][]} */
  const leg = [["hip", ""], ["knee", "hip"], ["ankle", "knee"], ["foot", "ankle"]];
  /** @type {[keyof typeof WORDS.roles, string][]} */
  const arm = [["shoulder", ""], ["elbow", "shoulder"], ["wrist", "elbow"], ["collar", ""]];
  for (const side of SIDES) {
    for (const [role, upper] of [...leg, ...arm]) find(`${side}_${role}`, role, side, bones.get(`${side}_${upper}`) ?? -1);
  }
  find("pelvis", "pelvis");
  const legs = [bones.get("left_hip"), bones.get("right_hip")];
  if (legs[0] !== undefined && legs[1] !== undefined) {
    const shared = above[legs[0]].filter((k) => above[/** @type {number} */ (legs[1])].includes(k));
    if (!shared.includes(bones.get("pelvis") ?? -1) && shared.length) bones.set("pelvis", shared[0]);
  }
  find("neck", "neck");
  find("head", "head", "", bones.get("neck") ?? -1);
  const low = bones.get("pelvis"), top = bones.get("neck") ?? bones.get("head");
  if (low !== undefined && top === undefined) return new Map([...bones, ...trunk(rig, bones, named, above)]);
  if (low === undefined || top === undefined || !above[top].includes(low)) return bones;
  const line = above[top].slice(0, above[top].indexOf(low)).reverse().filter((k) => named[k].rest);
  return new Map([...bones, ...spreadSpine(line)]);
}

/**
 * Spine, neck and head of a rig that only numbers them, as Rigify: by where arms branch off.
 * @param {Rig} rig @param {Map<string, number>} bones @param {{ side: string, rest: string }[]} named
 * @param {number[][]} above @returns {[string, number][]}
 */
function trunk(rig, bones, named, above) {
  const [left, right] = SIDES.map((side) => bones.get(`${side}_collar`) ?? bones.get(`${side}_shoulder`) ?? -1);
  const pelvis = bones.get("pelvis") ?? -1;
  const chest = left < 0 || right < 0 ? undefined : above[left].find((k) => above[right].includes(k));
  if (chest === undefined || !above[chest].includes(pelvis)) return [];
  const chain = [];
  const onward = (/** @type {number} */ node) => rig.children[node].filter((k) => named[k].rest && !named[k].side);
  for (let next = onward(chest); next.length === 1; next = onward(next[0])) chain.push(next[0]);
  const line = above[chest].slice(0, above[chest].indexOf(pelvis)).reverse().filter((k) => named[k].rest);
  const found = spreadSpine([...line, chest]);
  const extent = [0, 1, 2].map((n) => {
    const values = rig.nodes.map((_, k) => rig.places[3 * k + n]);
    return Math.max(...values) - Math.min(...values);
  });
  const rest = joints(rig, chain, 0.01 * Math.max(...extent));
  if (rest.length > 1) found.push(["neck", rest[0]]);
  const head = rest.at(-1);
  if (head !== undefined) found.push(["head", head]);
  return found;
}

/** Legs end lowest, the spine goes up between them, arms branch to both sides. @param {Rig} rig @param {Basis} basis */
function byShape(rig, basis) {
  const height = rig.nodes.map((_, k) => dot(rig.place(k), basis.up));
  const floor = Math.min(...height);
  const tall = Math.max(...height) - floor;
  /** @type {Map<string, number>} */
  const none = new Map();
  if (!(tall > 0)) return none;
  const level = (/** @type {Float64Array} */ v) => v.map((value, n) => value - dot(v, basis.up) * basis.up[n]);
  const below = rig.nodes.map((_, k) => subtree(rig, k));
  const lowest = below.map((nodes) => nodes.reduce((low, k) => (height[k] < height[low] ? k : low)));
  let best = null;
  rig.children.forEach((children, k) => {
    const feet = children.filter((child) => height[lowest[child]] < floor + 0.1 * tall);
    feet.forEach((a, n) => feet.slice(n + 1).forEach((b) => {
      const gap = level(minus(rig.place(lowest[a]), rig.place(lowest[b])));
      if (Math.hypot(...gap) > 0.05 * tall) best = [k, a, b]; // parents come first: the deepest stays
    }));
  });
  if (!best) return none;
  const [pelvis, ...legs] = /** @type {number[]} */ (best);
  const chains = legs.map((leg) => joints(rig, path(rig, leg, lowest[leg]), 0.03 * tall));
  if (chains.some(({ length }) => length < 3)) return none;
  const toes = chains.map((chain) => minus(rig.place(chain[Math.min(3, chain.length - 1)]), rig.place(chain[2])));
  const forward = level(toes[0].map((value, n) => value + toes[1][n]));
  const across = level(minus(rig.place(legs[0]), rig.place(legs[1])));
  if (Math.hypot(...forward) < 0.01 * tall) return none; // no toes: nothing tells front from back
  const left = cross(basis.up, forward).map((value) => basis.handed * value);
  if (dot(across, left) < 0) chains.reverse();
  const bones = new Map([["pelvis", pelvis]]);
  SIDES.forEach((side, s) => {
    ["hip", "knee", "ankle", "foot"].forEach((bone, k) => chains[s][k] !== undefined && bones.set(`${side}_${bone}`, chains[s][k]));
  });
  const top = below[pelvis].reduce((high, k) => (height[k] > height[high] ? k : high));
  const length = Math.hypot(...left);
  const spine = path(rig, pelvis, top).slice(1);
  return new Map([...bones, ...upper(rig, spine, below, left.map((value) => value / length), tall)]);
}

/**
 * @param {Rig} rig @param {number[]} spine @param {number[][]} below @param {Float64Array} left @param {number} tall
 * @returns {[string, number][]}
 */
function upper(rig, spine, below, left, tall) {
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

/** @param {Float64Array} a @param {Float64Array} b */
function minus(a, b) {
  return a.map((value, n) => value - b[n]);
}

/** @param {Rig} rig @param {number} node */
function subtree(rig, node) {
  const found = [node];
  for (const k of found) found.push(...rig.children[k]);
  return found;
}

/** @param {Rig} rig @param {number} top @param {number} bottom */
function path(rig, top, bottom) {
  const line = [bottom, ...rig.ancestors(bottom)];
  return line.slice(0, line.indexOf(top) + 1).reverse();
}

/** Of a path, those at least so far from the one before. @param {Rig} rig @param {number[]} line @param {number} least */
function joints(rig, line, least) {
  /** @type {number[]} */
  const found = [];
  for (const k of line) {
    const last = found.at(-1);
    if (last === undefined || Math.hypot(...minus(rig.place(k), rig.place(last))) >= least) found.push(k);
  }
  return found;
}
