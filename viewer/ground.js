// The ground on which the middles of people may be, as triangles, and the blocks that rise from it. No DOM, no three.js.

const CELL = 1; // metres, of the grid that finds the triangles near a place
const UNDER = 0.6; // metres that a person may be below the ground, since nothing is exact

/** Walkable ground. Points are { x, y, z }, y up, metres. */
export class Ground {
  /** `vertices` are [{ x, y, z }], `triangles` are [[i, j, k]]. */
  constructor(vertices, triangles) {
    this.corners = triangles.map((triangle) => triangle.map((vertex) => vertices[vertex]));
    this.cells = new Map();
    this.corners.forEach((corners, triangle) => {
      const [x0, x1] = span(corners, "x");
      const [z0, z1] = span(corners, "z");
      for (let x = cell(x0); x <= cell(x1); x += 1) {
        for (let z = cell(z0); z <= cell(z1); z += 1) {
          const key = keyOf(x, z);
          if (!this.cells.has(key)) this.cells.set(key, []);
          this.cells.get(key).push(triangle);
        }
      }
    });
  }

  /** Height of the ground below a point at height `y`, on its own storey; or null. */
  heightAt(x, z, y = 0) {
    let best = null;
    for (const triangle of this.cells.get(keyOf(cell(x), cell(z))) ?? []) {
      const height = heightIn(this.corners[triangle], x, z);
      if (height === null) continue;
      const better = best === null || (height <= y + UNDER ? best > y + UNDER || height > best : height < best);
      if (better) best = height;
    }
    return best;
  }

  /** Where a ray { origin, direction } first meets the ground from above; or null. */
  meets(ray) {
    const { origin, direction } = ray;
    let nearest = Infinity;
    for (const corners of this.corners) {
      const along = rayMeets(origin, direction, corners);
      if (along < nearest) nearest = along;
    }
    return nearest < Infinity ? pointOn(ray, nearest) : null;
  }
}

/** Where a ray meets the level plane at height `y`; or null. */
export function planePoint(ray, y = 0) {
  const { origin, direction } = ray;
  const along = (y - origin.y) / direction.y;
  return along > 0 && Number.isFinite(along) ? pointOn(ray, along) : null;
}

/** Metres along a ray to where it enters a block { top: [{ x, y, z }], bottom }, or Infinity. */
export function blockMeets({ origin, direction }, { top, bottom }) {
  const height = Math.max(...top.map(({ y }) => y));
  const lid = planePoint({ origin, direction }, height);
  let nearest = Infinity;
  if (lid && direction.y < 0 && contains(top, lid)) {
    nearest = Math.hypot(lid.x - origin.x, lid.y - origin.y, lid.z - origin.z);
  }
  top.forEach((a, k) => {
    const b = top[(k + 1) % top.length];
    const feet = [{ ...a, y: bottom }, { ...b, y: bottom }];
    for (const corners of [[feet[0], feet[1], b], [feet[0], b, a]]) {
      const along = rayMeets(origin, direction, corners);
      if (along < nearest) nearest = along;
    }
  });
  return nearest;
}

/** Whether a ring of { x, z } holds a point, seen from above. */
export function contains(ring, { x, z }) {
  let inside = false;
  ring.forEach((a, k) => {
    const b = ring[(k + 1) % ring.length];
    if ((a.z > z) !== (b.z > z) && x < a.x + ((z - a.z) * (b.x - a.x)) / (b.z - a.z)) inside = !inside;
  });
  return inside;
}

function heightIn([a, b, c], x, z) {
  const area = (b.x - a.x) * (c.z - a.z) - (c.x - a.x) * (b.z - a.z);
  if (Math.abs(area) < 1e-12) return null;
  const v = ((x - a.x) * (c.z - a.z) - (c.x - a.x) * (z - a.z)) / area;
  const w = ((b.x - a.x) * (z - a.z) - (x - a.x) * (b.z - a.z)) / area;
  if (v < -1e-6 || w < -1e-6 || v + w > 1 + 1e-6) return null;
  return a.y + v * (b.y - a.y) + w * (c.y - a.y);
}

/** Möller–Trumbore: metres along the ray (both faces), or Infinity. */
function rayMeets(origin, direction, [a, b, c]) {
  const e = [b.x - a.x, b.y - a.y, b.z - a.z];
  const f = [c.x - a.x, c.y - a.y, c.z - a.z];
  const d = [direction.x, direction.y, direction.z];
  const p = cross(d, f);
  const volume = dot(e, p);
  if (Math.abs(volume) < 1e-12) return Infinity;
  const t = [origin.x - a.x, origin.y - a.y, origin.z - a.z];
  const v = dot(t, p) / volume;
  const q = cross(t, e);
  const w = dot(d, q) / volume;
  if (v < 0 || w < 0 || v + w > 1) return Infinity;
  const along = dot(f, q) / volume;
  return along > 1e-6 ? along : Infinity;
}

const cell = (value) => Math.floor(value / CELL);
const keyOf = (x, z) => 2 ** 20 * x + z; // of a cell: a string would be made for each person in each picture
const span = (corners, axis) => [Math.min(...corners.map((c) => c[axis])), Math.max(...corners.map((c) => c[axis]))];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** The point of a ray { origin, direction } at a distance in metres. */
export function pointOn({ origin, direction }, along) {
  return {
    x: origin.x + along * direction.x, y: origin.y + along * direction.y, z: origin.z + along * direction.z,
  };
}
