// The look of blocks by their size: houses have windows, doors and roofs, trees have crowns, and smaller blocks are furniture
// (furniture.js). No DOM, no three.js.

import { furnitureOf } from "./furniture.js";
import { dot, facing, middleOf, quad, sides } from "./facets.js";

const HOUSE = { high: 6, wide: 4 }; // metres, at least
const TREE = { high: 4, wide: 0.8, corners: 12 }; // metres at least, at most; a round trunk has more corners
const STOREY = 2.9, BAY = 2.7; // metres between windows, up and along
const WINDOW = { wide: 1.1, high: 1.5, sill: 1.0, glow: 0.8 };
const DOOR = { wide: 1.2, high: 2.2, sill: 0 };
const OUT = 0.03; // metres before the wall: at one depth they would flicker
const ROOF = { high: 2.2, over: 0.5, flat: 0.02 };
const COLOURS = { window: "#46545f", door: "#5d4331", roof: "#9c5a41", frame: "#efe9dc" };
const LEAVES = ["#5d7d43", "#6b8a4c", "#52713c"];
const CROWN = 1.9; // metres, its radius
const BLOBS = [[0, 0.5, 0, 1.35], [0.75, -0.1, 0.35, 1.05], [-0.6, 0, 0.6, 1.0], [0, -0.15, -0.8, 1.05]]; // x, y, z, radius
const AROUND = 10, UP = 6;

/** Middle of a tree's crown { x, y, z }; null for a block that is no tree. */
export function crownOf({ top, bottom }) {
  const [{ y }] = top;
  if (y - bottom < TREE.high || top.length <= TREE.corners || Math.min(...sides(top)) > TREE.wide) return null;
  const middle = middleOf(top);
  return { x: middle.x, y: y + 0.4, z: middle.z };
}

/** Whether a crown surrounds an eye, or hides a point from it. */
export function crownHides(crown, eye, point) {
  const way = [point.x - eye.x, point.y - eye.y, point.z - eye.z], to = [crown.x - eye.x, crown.y - eye.y, crown.z - eye.z];
  const along = Math.min(1, Math.max(0, dot(way, to) / (dot(way, way) || 1)));
  const gap = Math.hypot(...to.map((value, k) => value - along * way[k]));
  return gap < CROWN + (along === 0 ? 1 : 0);
}

/**
 * How a block is drawn: whether its own `walls` are, and additional triangles [{ corners: [a, b, c], normals: [a, b, c], colour,
 * light, glow }] of points { x, y, z }. `light` scales the colour, and `glow` is what shines of it at night, if anything. `number`
 * makes neighbours differ.
 */
export function dressingOf(block, number) {
  const crown = crownOf(block);
  if (crown) {
    const leaves = BLOBS.flatMap((blob, k) => blobOf(crown, blob, LEAVES[(number + k) % LEAVES.length], number));
    return { walls: true, triangles: leaves };
  }
  const { top, bottom } = block;
  if (top.length === 4 && top[0].y - bottom >= HOUSE.high && Math.min(...sides(top)) >= HOUSE.wide) {
    const fronts = top.flatMap((a, k) => frontOf(a, top[(k + 1) % 4], bottom, middleOf(top), number + k));
    return { walls: true, triangles: [...fronts, ...roofOf(top)] };
  }
  const furniture = furnitureOf(block, number);
  return { walls: !furniture, triangles: furniture ?? [] };
}

/** Windows of a wall between two corners, some of them lit at night, and a door in its middle. */
function frontOf(a, b, bottom, middle, number) {
  const length = Math.hypot(b.x - a.x, b.z - a.z);
  const on = { x: (b.x - a.x) / length, z: (b.z - a.z) / length };
  let out = { x: -on.z, y: 0, z: on.x };
  if (out.x * (a.x - middle.x) + out.z * (a.z - middle.z) < 0) out = { x: -out.x, y: 0, z: -out.z };
  const bays = Math.floor(length / BAY), storeys = Math.floor((a.y - bottom) / STOREY);
  const found = [];
  for (let bay = 0; bay < bays; bay += 1) {
    const along = (length * (bay + 0.5)) / bays;
    for (let storey = 0; storey < storeys; storey += 1) {
      const door = storey === 0 && bay === Math.floor(bays / 2);
      const { wide, high, sill } = door ? DOOR : WINDOW;
      const low = bottom + storey * STOREY + sill;
      const lit = !door && (7 * number + 5 * bay + 3 * storey) % 8 < 3; // somebody is at home
      const pane = (margin, depth, colour, glow) => {
        const corner = (side, y) => ({ x: a.x + on.x * (along + side) + out.x * depth, y, z: a.z + on.z * (along + side) + out.z * depth });
        const [w, y0, y1] = [wide / 2 + margin, Math.max(bottom, low - margin), low + high + margin];
        const ring = [corner(-w, y0), corner(w, y0), corner(w, y1), corner(-w, y1)];
        found.push(...quad(ring, out, colour, glow));
      };
      pane(0.12, OUT, COLOURS.frame);
      pane(0, 2 * OUT, door ? COLOURS.door : COLOURS.window, lit ? WINDOW.glow : 0);
    }
  }
  return found;
}

/** A hipped roof over four corners. */
function roofOf(top) {
  const middle = middleOf(top);
  const eaves = top.map(({ x, y, z }) => {
    const reach = Math.hypot(x - middle.x, z - middle.z), share = 1 + ROOF.over / reach;
    return { x: middle.x + (x - middle.x) * share, y: y + ROOF.flat, z: middle.z + (z - middle.z) * share };
  });
  const tip = { x: middle.x, y: eaves[0].y + ROOF.high, z: middle.z };
  return eaves.map((a, k) => {
    const b = eaves[(k + 1) % 4];
    const edge = { x: b.x - a.x, z: b.z - a.z }, length = Math.hypot(edge.x, edge.z);
    const half = { x: (a.x + b.x) / 2 - middle.x, z: (a.z + b.z) / 2 - middle.z };
    let flat = { x: -edge.z / length, z: edge.x / length };
    if (flat.x * half.x + flat.z * half.z < 0) flat = { x: -flat.x, z: -flat.z };
    const run = flat.x * half.x + flat.z * half.z, slope = Math.hypot(run, ROOF.high);
    const normal = { x: (flat.x * ROOF.high) / slope, y: run / slope, z: (flat.z * ROOF.high) / slope };
    return facing([a, b, tip], normal, COLOURS.roof);
  });
}

/** A ball of leaves, not quite round, darker below. */
function blobOf(crown, [x, y, z, radius], colour, number) {
  const turn = number * 2.4; // trees differ
  const middle = { x: crown.x + x * Math.cos(turn) + z * Math.sin(turn), y: crown.y + y, z: crown.z + z * Math.cos(turn) - x * Math.sin(turn) };
  const normalAt = (i, j) => {
    const up = Math.PI * (j / UP - 0.5), around = (2 * Math.PI * (i % AROUND)) / AROUND;
    return { x: Math.cos(up) * Math.cos(around), y: Math.sin(up), z: Math.cos(up) * Math.sin(around) };
  };
  const placeAt = (i, j) => {
    const { x: nx, y: ny, z: nz } = normalAt(i, j);
    const reach = radius * (1 + 0.09 * Math.sin(5 * (i % AROUND) + 3 * j + number) * Math.cos((Math.PI * (2 * j - UP)) / (2 * UP)));
    return { x: middle.x + reach * nx, y: middle.y + 0.85 * reach * ny, z: middle.z + reach * nz };
  };
  const found = [];
  for (let j = 0; j < UP; j += 1) {
    for (let i = 0; i < AROUND; i += 1) {
      for (const ring of [[[i, j], [i, j + 1], [i + 1, j + 1]], [[i, j], [i + 1, j + 1], [i + 1, j]]]) {
        const normals = ring.map(([p, q]) => normalAt(p, q));
        found.push({ corners: ring.map(([p, q]) => placeAt(p, q)), normals, colour, light: 0.8 + 0.25 * normals[1].y });
      }
    }
  }
  return found;
}
