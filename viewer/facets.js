// Triangles of simple forms, as dressing.js returns them: quads, boxes, round forms. No DOM, no three.js.

const ROUND = 20; // corners of a round form

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export function quad([a, b, c, d], normal, colour, glow = 0) {
  return [facing([a, b, c], normal, colour, glow), facing([a, c, d], normal, colour, glow)];
}

/** A flat triangle that is visible from the side of its normal. */
export function facing([a, b, c], normal, colour, glow = 0) {
  const u = [b.x - a.x, b.y - a.y, b.z - a.z], v = [c.x - a.x, c.y - a.y, c.z - a.z];
  const across = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const corners = dot(across, [normal.x, normal.y, normal.z]) > 0 ? [a, b, c] : [a, c, b];
  return { corners, normals: [normal, normal, normal], colour, light: 1, glow };
}

export function middleOf(ring) {
  const mean = (axis) => ring.reduce((sum, point) => sum + point[axis], 0) / ring.length;
  return { x: mean("x"), z: mean("z") };
}

/** Extent of a ring along x and z; for four corners, the lengths of its sides. */
export function sides(ring) {
  if (ring.length === 4) return [0, 1].map((k) => Math.hypot(ring[k + 1].x - ring[k].x, ring[k + 1].z - ring[k].z));
  return ["x", "z"].map((axis) => Math.max(...ring.map((p) => p[axis])) - Math.min(...ring.map((p) => p[axis])));
}

/** Axes of a rectangle's outline, its longer side first, from its middle: { long, wide: metres, at(u, y, v), turned(u, y, v) }. */
export function frameOf(top) {
  const [first, second] = sides(top);
  const [a, b] = first >= second ? [top[0], top[1]] : [top[1], top[2]];
  const long = Math.max(first, second), { x, z } = middleOf(top);
  const on = { x: (b.x - a.x) / long, z: (b.z - a.z) / long };
  const turned = (u, y, v) => ({ x: on.x * u - on.z * v, y, z: on.z * u + on.x * v });
  const at = (u, y, v) => ({ x: x + on.x * u - on.z * v, y, z: z + on.z * u + on.x * v });
  return { long, wide: Math.min(first, second), at, turned };
}

/** A box between [u, y, v] and [u, y, v] of a frame; all six sides. */
export function boxOf({ at, turned }, low, high, colour, glow = 0) {
  return [0, 1, 2].flatMap((axis) => [low, high].flatMap((end, side) => {
    const [p, q] = [0, 1, 2].filter((other) => other !== axis);
    const ring = [[low, low], [high, low], [high, high], [low, high]].map(([one, two]) => {
      const corner = [];
      corner[axis] = end[axis];
      corner[p] = one[p];
      corner[q] = two[q];
      return at(...corner);
    });
    const normal = [0, 0, 0];
    normal[axis] = 2 * side - 1;
    return quad(ring, turned(...normal), colour, glow);
  }));
}

/** The surface of a line [[radius, y, colour, glow] …] turned about a middle { x, z }; a part has the colour of its end. */
export function turnedOf({ x, z }, line) {
  const place = (radius, y, k) => ({ x: x + radius * Math.cos((2 * Math.PI * k) / ROUND), y, z: z + radius * Math.sin((2 * Math.PI * k) / ROUND) });
  return line.slice(1).flatMap(([radius, y, colour, glow = 0], part) => {
    const [before, low] = line[part], length = Math.hypot(radius - before, y - low) || 1;
    const normalAt = (k) => {
      const angle = (2 * Math.PI * k) / ROUND, out = (y - low) / length;
      return { x: out * Math.cos(angle), y: (before - radius) / length, z: out * Math.sin(angle) };
    };
    return Array.from({ length: ROUND }, (_, k) => k).flatMap((k) => {
      const ring = [[before, low, k], [before, low, k + 1], [radius, y, k + 1], [radius, y, k]].map((one) => place(...one));
      const flat = (three) => (before === 0 && three[1] === 1) || (radius === 0 && three[1] === 2); // at a tip
      return [[0, 1, 2], [0, 2, 3]].filter((three) => !flat(three)).map((three) => {
        const triangle = facing(three.map((corner) => ring[corner]), normalAt(k + 0.5), colour, glow);
        return { ...triangle, normals: triangle.corners.map((corner) => normalAt([0, 3].includes(ring.indexOf(corner)) ? k : k + 1)) };
      });
    });
  });
}
