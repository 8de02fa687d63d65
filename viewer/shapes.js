// Blocks and ground as triangles for drawing: flat arrays of numbers. No DOM, no three.js.

const PLAIN = { walls: true, triangles: [] };

/**
 * Corners (x, y, z each) and normals of blocks { top: [{ x, y, z }], bottom }, and the lines along their upright and upper edges.
 * `starts[k]` is the first vertex of block k, and the last entry their count. `dressed[k]` is the first vertex that `dressingOf`
 * (dressing.js) adds to it or draws instead. `paints` has { colour, light, glow } for each of those triangles.
 * `triangulate(ring)` returns triangles [[i, j, k]] of a ring of { x, z }.
 */
export function blockMesh(blocks, triangulate, dressingOf = () => PLAIN) {
  const corners = [];
  const normals = [];
  const lines = [];
  const starts = [0];
  const dressed = [];
  const paints = [];
  blocks.forEach(({ top, bottom }, number) => {
    const { walls, triangles } = dressingOf({ top, bottom }, number);
    if (walls) addWalls({ corners, normals, lines }, { top, bottom }, number, triangulate);
    dressed.push(corners.length / 3);
    for (const { corners: ring, normals: up, colour, light, glow } of triangles) {
      pushPoints(corners, ...ring);
      pushPoints(normals, ...up);
      paints.push({ colour, light, glow });
    }
    starts.push(corners.length / 3);
  });
  return {
    corners: Float32Array.from(corners), normals: Float32Array.from(normals), lines: Float32Array.from(lines), starts, dressed, paints,
  };
}

/** A block's top and sides, and their lines. */
function addWalls({ corners, normals, lines }, { top, bottom }, number, triangulate) {
  const raised = top.map((point) => ({ ...point, y: point.y + lift(point.y - bottom, number) }));
  const ring = signedArea(top) > 0 ? raised : raised.reverse();
  for (const [i, j, k] of triangulate(ring)) {
    const [a, b, c] = [ring[i], ring[j], ring[k]];
    const up = normalOf(a, b, c);
    addTriangle(corners, normals, ...(up.y > 0 ? [a, b, c, up] : [a, c, b, minus(up)]));
  }
  ring.forEach((a, k) => {
    const b = ring[(k + 1) % ring.length];
    const [foot, next] = [{ ...a, y: bottom }, { ...b, y: bottom }];
    const out = outward(a, b);
    addTriangle(corners, normals, foot, next, b, out);
    addTriangle(corners, normals, foot, b, a, out);
    pushPoints(lines, a, b);
    if (ring.length <= UPRIGHTS) pushPoints(lines, foot, a);
  });
}

/** Tall blocks that overlap at one height would flicker, so their heights differ a little. */
function lift(height, number) {
  return height > TALL ? 0.02 * (number % 5) : 0;
}

const TALL = 2.5; // metres: nobody walks on top of it
const UPRIGHTS = 12; // a ring of more corners is round: lines along its side would not be edges

/** Edges of the ground that only one triangle has: its outline. [x, y, z, x, y, z …] */
export function outlineOf(vertices, triangles) {
  const seen = new Map();
  for (const [i, j, k] of triangles) {
    for (const [a, b] of [[i, j], [j, k], [k, i]]) {
      const key = a < b ? `${a},${b}` : `${b},${a}`;
      if (!seen.delete(key)) seen.set(key, [a, b]);
    }
  }
  const lines = [];
  for (const [a, b] of seen.values()) pushPoints(lines, vertices[a], vertices[b]);
  return Float32Array.from(lines);
}

/** Length along x and z, and middle, of the points that a camera should see. */
export function extentOf(points) {
  const range = (axis) => points.reduce(([low, high], point) => [Math.min(low, point[axis]), Math.max(high, point[axis])], [Infinity, -Infinity]);
  const [[x0, x1], [y0, y1], [z0, z1]] = [range("x"), range("y"), range("z")];
  return { x: (x0 + x1) / 2, z: (z0 + z1) / 2, low: y0, high: y1, size: Math.max(x1 - x0, z1 - z0) };
}

/** Twice the area; positive if the ring runs so that `outward` points out. */
function signedArea(ring) {
  return ring.reduce((sum, a, k) => {
    const b = ring[(k + 1) % ring.length];
    return sum + b.x * a.z - a.x * b.z;
  }, 0);
}

function outward(a, b) {
  const length = Math.hypot(b.x - a.x, b.z - a.z) || 1;
  return { x: -(b.z - a.z) / length, y: 0, z: (b.x - a.x) / length };
}

function normalOf(a, b, c) {
  const [ux, uy, uz] = [b.x - a.x, b.y - a.y, b.z - a.z];
  const [vx, vy, vz] = [c.x - a.x, c.y - a.y, c.z - a.z];
  const [x, y, z] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
  const length = Math.hypot(x, y, z) || 1;
  return { x: x / length, y: y / length, z: z / length };
}

const minus = ({ x, y, z }) => ({ x: -x, y: -y, z: -z });

function addTriangle(corners, normals, a, b, c, normal) {
  pushPoints(corners, a, b, c);
  pushPoints(normals, normal, normal, normal);
}

function pushPoints(into, ...points) {
  for (const { x, y, z } of points) into.push(x, y, z);
}
