// Soles of a character, from its mesh at rest: clients/README.md, "Retargeting", 5.

import { BASES, dot } from "./bases.js";
import { rotate } from "./quaternions.js";
import { LEGS, alignment } from "./retarget_rest.js";
import { BONES } from "./rig.js";

const STEEP = [45, 75]; // outermost points are looked for in these directions: degrees off straight down
const ROUND = 8; // number of directions around the vertical, for each of these angles

/**
 * Points of a mesh at rest that may touch the ground, in the basis. `floor` is the height of the lowest. `feet`: left
 * and right, x, y, z of the points that the ankle moves, from the ankle's joint, and of the points that the toes move,
 * from the toes' joint.
 * @typedef {{ floor: number, feet: { fixed: Float64Array, toes: Float64Array }[] }} Soles
 */

/**
 * The soles of a character. `places` are its mesh's vertices (x, y, z each) at rest, in its own space; `nodes` are the
 * nodes of the rig that move each most. Null: a foot has no vertices, or they end above its ankle.
 * @param {import("./bone_map.js").BoneMap} map @param {ArrayLike<number>} places @param {ArrayLike<number>} nodes
 * @param {import("./bases.js").Basis} [basis] @returns {Soles | null}
 */
export function measureSoles({ rig, bones }, places, nodes, basis = BASES.gltf) {
  const turn = alignment(rig, bones, basis);
  const numbers = new Map([...bones].map(([bone, node]) => [node, BONES.indexOf(bone)]));
  const owner = rig.nodes.map((_, k) => {
    const line = [k, ...rig.ancestors(k)];
    const node = line.find((n) => numbers.has(n));
    return node === undefined ? -1 : /** @type {number} */ (numbers.get(node));
  });
  const directions = directionsOf(basis);
  const v = new Float64Array(3);
  let floor = Infinity;
  /** @type {Soles["feet"]} */
  const feet = [];
  for (const [, , ankle, toe] of LEGS) {
    const [fixed, toes] = [ankle, toe].map((bone) => {
      const node = bones.get(BONES[bone]);
      const best = directions.map(() => -Infinity);
      /** @type {number[][]} */
      const found = [];
      for (let k = 0; node !== undefined && k < nodes.length; k += 1) {
        if (owner[nodes[k]] !== bone) continue;
        for (let n = 0; n < 3; n += 1) v[n] = places[3 * k + n];
        rotate(turn, 0, v, 0, v, 0);
        floor = Math.min(floor, dot(v, basis.up));
        directions.forEach((direction, d) => {
          const far = dot(v, direction);
          if (far <= best[d]) return;
          best[d] = far;
          found[d] = [v[0], v[1], v[2]];
        });
      }
      if (!found.length) return new Float64Array();
      const joint = rig.place(/** @type {number} */ (node));
      rotate(turn, 0, joint, 0, joint, 0);
      const unique = [...new Map(found.map((point) => [point.join(), point])).values()];
      return Float64Array.from(unique.flatMap((point) => point.map((value, n) => value - joint[n])));
    });
    const joint = rig.place(/** @type {number} */ (bones.get(BONES[ankle])));
    rotate(turn, 0, joint, 0, joint, 0);
    if (!(fixed.length || toes.length) || floor >= dot(joint, basis.up)) return null;
    feet.push({ fixed, toes });
  }
  return { floor, feet };
}

/** Directions down, and obliquely down all around. @param {import("./bases.js").Basis} basis */
function directionsOf({ left, up, forward }) {
  const found = [up.map((value) => -value)];
  for (const degrees of STEEP) {
    const steep = (degrees * Math.PI) / 180;
    for (let k = 0; k < ROUND; k += 1) {
      const angle = (2 * Math.PI * k) / ROUND;
      found.push(up.map((value, n) => (
        Math.sin(steep) * (Math.cos(angle) * forward[n] + Math.sin(angle) * left[n]) - Math.cos(steep) * value
      )));
    }
  }
  return found;
}
