// What the mesh of a character at rest tells of its soles: clients/README.md, "Retargeting", 5.

import { BASES, dot } from "./bases.js";
import { rotate } from "./quaternions.js";
import { LEGS, alignment } from "./retarget_rest.js";
import { BONES } from "./rig.js";

const STEEP = [45, 75]; // degrees off straight down of the directions in which the outermost points are looked for
const ROUND = 8; // how many of these directions there are round about

/**
 * Points of a mesh that may touch the ground, in the basis, at rest: `floor` is the height of the lowest; `feet`: of the
 * left and the right foot, x, y, z from the ankle's joint of those that the ankle moves, and from the toes' joint of
 * those that the toes move.
 * @typedef {{ floor: number, feet: { fixed: Float64Array, toes: Float64Array }[] }} Soles
 */

/**
 * The soles of a character whose mesh has vertices at `places` (x, y, z each, in its own space at rest), each of which
 * the node `nodes` of the rig moves most. Null: a foot has no vertices, or they end above its ankle.
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

/** Down, and obliquely down all round. @param {import("./bases.js").Basis} basis */
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
