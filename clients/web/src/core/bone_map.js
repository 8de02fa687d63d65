// Maps nodes of a rig to bones: by VRM's table, otherwise by names, otherwise by shape. clients/README.md, "Bones of a
// character", has the rules and the refusals.

import { BASES, cross, dot } from "./bases.js";
import { WORDS } from "./bone_names.js";
import { SIDES, byNames, byVrm } from "./bones_by_name.js";
import { Shape, contradicted, subtree } from "./bones_by_shape.js";
import { BONES, PARENTS } from "./rig.js";

const REQUIRED = ["pelvis", ...SIDES.flatMap((side) => ["hip", "knee", "ankle"].map((bone) => `${side}_${bone}`))];
const TRUNK = ["pelvis", "spine1", "spine2", "spine3", "neck", "head"];
const BRANCHING = ["hip", "collar", "shoulder"]; // they may hang from any bone of the trunk: they move with that bone
const UNEVEN = 1.01; // greatest ratio between the scales of a node's axes
const BACKWARD = 0.2; // cosine of the angle up to which toes may point backwards
const HEELS = 0.3; // greatest height of an ankle over the lowest node of its leg, as a share of the thigh's height
const HINDLEGS = "legs as animals' hind legs, whose heels are off the ground, are not found by their shape. Say which bones these are, by a correction";

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

  /** Bones that the rig lacks; their children take over their rotations. */
  get missing() {
    return BONES.filter((bone) => !this.bones.has(bone));
  }

  /** Canonical name → name of the node: to show it, or keep it. @returns {Record<string, string>} */
  table() {
    return Object.fromEntries([...this.bones].map(([bone, node]) => [bone, this.rig.nodes[node].name]));
  }

  /**
   * The map with other nodes for some bones (by node name), or without them (null). Throws when that is no humanoid.
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
 * The map of a rig. `humanoid`: VRM's names → nodes. `basis`: gives the up of the rig's space. `correct`: as for
 * `corrected`; it also serves rigs that lack bones. Throws BoneMapError that says what is missing, or why the rig is no
 * biped.
 * @param {Rig} rig @param {Record<string, number> | null} [humanoid] @param {Basis} [basis]
 * @param {Record<string, string | null>} [correct]
 */
export function mapBones(rig, humanoid = null, basis = BASES.gltf, correct = {}) {
  const [found, foundBy] = find(rig, humanoid, basis);
  if (Object.keys(correct).length) return new BoneMap(rig, changed(rig, found, correct), "user");
  const map = new BoneMap(rig, kept(rig, found), foundBy);
  checkBiped(rig, map.bones, basis);
  return map;
}

/**
 * @param {Rig} rig @param {Record<string, number> | null} humanoid @param {Basis} basis
 * @returns {[Map<string, number>, "vrm" | "names" | "shape"]}
 */
function find(rig, humanoid, basis) {
  if (humanoid && Object.keys(humanoid).length) return [byVrm(humanoid), "vrm"];
  const named = byNames(rig);
  if (REQUIRED.every((bone) => named.has(bone))) return [named, "names"];
  const shaped = new Shape(rig, basis).bones();
  if (REQUIRED.every((bone) => shaped.has(bone))) return [shaped, "shape"];
  return [named, "names"];
}

/** The bones without optional ones whose place is impossible. @param {Rig} rig @param {Map<string, number>} bones */
function kept(rig, bones) {
  const left = new Map(BONES.flatMap((bone) => (bones.has(bone) ? [/** @type {[string, number]} */ ([bone, bones.get(bone)])] : [])));
  for (const bone of BONES) {
    if (left.has(bone) && !REQUIRED.includes(bone) && misplaced(rig, left, bone)) left.delete(bone);
  }
  return left;
}

/**
 * The bone that this one wrongly hangs from or shares a node with; "": none.
 * @param {Rig} rig @param {Map<string, number>} bones @param {string} bone
 */
function misplaced(rig, bones, bone) {
  const node = /** @type {number} */ (bones.get(bone));
  const twin = [...bones].find(([other, n]) => n === node && other !== bone);
  if (twin) return twin[0];
  const boneOf = new Map([...bones].map(([other, n]) => [n, other]));
  const above = rig.ancestors(node).map((n) => boneOf.get(n)).find(Boolean) ?? "";
  if (!above || lineOf(bone).includes(above)) return "";
  const branches = BRANCHING.includes(bone.replace(/^(left|right)_/, "")) || TRUNK.includes(bone);
  return branches && TRUNK.includes(above) && !lineOf(above).includes(bone) ? "" : above;
}

/** The bones above a bone, up to the pelvis. @param {string} bone */
function lineOf(bone) {
  const found = [];
  for (let k = PARENTS[BONES.indexOf(bone)]; k >= 0; k = PARENTS[k]) found.push(BONES[k]);
  return found;
}

/** The bones in canonical order, if they are those of a humanoid. @param {Rig} rig @param {Map<string, number>} bones */
function checked(rig, bones) {
  const lacking = REQUIRED.filter((bone) => !bones.has(bone));
  if (lacking.length) {
    const roles = /** @type {(keyof typeof WORDS.roles)[]} */ ([...new Set(lacking.map((bone) => bone.replace(/^(left|right)_/, "")))]);
    const known = roles.map((role) => `${role}: ${WORDS.roles[role].join(", ")}`).join("; ");
    throw new BoneMapError(
      `no node was found for ${lacking.join(", ")}, neither by names nor by shape: say which they are, by a correction. `
      + `Known names, with sides as in LeftFoot, foot_l, foot.L: ${known}`, bones,
    );
  }
  const found = new Map(BONES.flatMap((bone) => (bones.has(bone) ? [/** @type {[string, number]} */ ([bone, bones.get(bone)])] : [])));
  for (const [bone, node] of found) {
    const above = misplaced(rig, found, bone);
    if (!above) continue;
    const said = found.get(above) === node ? `is ${above}, too` : `hangs from ${above}`;
    throw new BoneMapError(`${bone}: "${rig.nodes[node].name}" ${said}`, bones);
  }
  for (const node of new Set([...found.values()].flatMap((k) => rig.ancestors(k)))) {
    const { name, scale = [1, 1, 1] } = rig.nodes[node];
    const sizes = Array.from(scale);
    const least = Math.min(...sizes), most = Math.max(...sizes);
    if (most > 0 && most <= UNEVEN * least) continue;
    throw new BoneMapError(
      `"${name}" is scaled by ${sizes.map((size) => Number(size.toPrecision(6))).join(", ")}: bones below it would be sheared or `
      + "mirrored as they turn. Apply its scale to the model, and export it again", bones,
    );
  }
  return found;
}

/** Throws for animals, and for sides that contradict each other. @param {Rig} rig @param {Map<string, number>} bones @param {Basis} basis */
function checkBiped(rig, bones, basis) {
  const node = (/** @type {string} */ bone) => /** @type {number} */ (bones.get(bone));
  const hips = SIDES.map((side) => node(`${side}_hip`));
  const refuse = (/** @type {string} */ message) => {
    throw new BoneMapError(message, bones);
  };
  const others = new Shape(rig, basis).otherLegs(node("pelvis"), hips);
  if (others) {
    const legs = [...hips, ...others].map((k) => `"${rig.nodes[k].name}"`).join(", ");
    refuse(`it has four legs (${legs}): only what walks on two can be animated`);
  }
  const name = contradicted(rig, bones);
  if (name) refuse(`"${name}" is on the other side than its name tells, by where the feet point: ${HINDLEGS}`);
  const up = new Float64Array(3), toes = new Float64Array(3);
  const add = (/** @type {Float64Array} */ sum, /** @type {number} */ to, /** @type {number} */ from) => {
    for (let n = 0; n < 3; n += 1) sum[n] += rig.places[3 * to + n] - rig.places[3 * from + n];
  };
  for (const side of SIDES) {
    add(up, node(`${side}_hip`), node(`${side}_ankle`));
    if (bones.has(`${side}_foot`)) add(toes, node(`${side}_foot`), node(`${side}_ankle`));
  }
  const high = rig.nodes.map((_, k) => dot(rig.place(k), up));
  for (const [s, side] of SIDES.entries()) {
    const ankle = node(`${side}_ankle`);
    const low = Math.min(...subtree(rig, ankle).map((k) => high[k]));
    if (high[ankle] - low <= HEELS * (high[hips[s]] - low)) continue;
    refuse(`"${rig.nodes[ankle].name}" is high above the ground for an ankle: ${HINDLEGS}`);
  }
  const across = rig.place(hips[0]).map((value, n) => value - rig.places[3 * hips[1] + n]);
  const forward = cross(across, up).map((value) => basis.handed * value);
  if (dot(toes, forward) < -BACKWARD * Math.hypot(...toes) * Math.hypot(...forward)) {
    refuse(
      "its toes point backwards: left and right are exchanged, or these are no feet "
      + `("${rig.nodes[hips[0]].name}" counts as left)`,
    );
  }
}
