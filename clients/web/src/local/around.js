// A way on a small grid around obstacles. It mirrors the server's world/scenes/around.py, which explains the rules.
// A grid is rows × columns, row by row.

const ROUNDS = 16, DIAGONAL = Math.sqrt(2);
const STEPS = [[0, 1], [1, 0], [0, -1], [-1, 0], [1, 1], [1, -1], [-1, -1], [-1, 1]];

/** @typedef {[number, number]} Cell row and column */
/** @typedef {{ room: Float64Array, rows: number, columns: number }} Grid `room`: metres more than a body needs */

/** Spread the costs of cells to their neighbours, in four orders; whether any has changed. @param {Grid} grid @param {number} least @param {Float64Array} cost */
function sweep({ room, rows, columns }, least, cost) {
  let changed = false;
  for (let order = 0; order < 4; order += 1) {
    for (let i = 0; i < rows; i += 1) {
      const r = order < 2 ? i : rows - 1 - i;
      for (let j = 0; j < columns; j += 1) {
        const c = order % 2 ? columns - 1 - j : j, at = columns * r + c;
        if (room[at] < least) continue;
        let best = cost[at];
        for (let k = 0; k < 8; k += 1) {
          const y = r + STEPS[k][0], x = c + STEPS[k][1];
          if (y >= 0 && y < rows && x >= 0 && x < columns) best = Math.min(best, cost[columns * y + x] + (k < 4 ? 1 : DIAGONAL));
        }
        if (best < cost[at]) {
          cost[at] = best;
          changed = true;
        }
      }
    }
  }
  return changed;
}

/**
 * Whether a straight line between two cells keeps the room, interpolated between cells.
 * @param {Grid} grid @param {number} least @param {Cell} from @param {Cell} to
 */
function sees({ room, rows, columns }, least, [r0, c0], [r1, c1]) {
  const steps = Math.ceil(2 * Math.sqrt((r1 - r0) ** 2 + (c1 - c0) ** 2));
  for (let k = 0; k <= steps; k += 1) {
    const share = k / Math.max(steps, 1);
    let y = r0 + share * (r1 - r0), x = c0 + share * (c1 - c0);
    const r = Math.min(Math.floor(y), rows - 2), c = Math.min(Math.floor(x), columns - 2), at = columns * r + c;
    y -= r;
    x -= c;
    const low = room[at] * (1 - x) + room[at + 1] * x, high = room[at + columns] * (1 - x) + room[at + columns + 1] * x;
    if (low * (1 - y) + high * y < least) return false;
  }
  return true;
}

/** The corners of a short way between two cells, both included; none without a way. An end without room is replaced by the nearest cell with room. @param {Grid} grid @param {Cell} start @param {Cell} end @returns {Cell[]} */
export function wayAround(grid, start, end) {
  const { room, rows, columns } = grid, cell = (/** @type {Cell} */ [r, c]) => columns * r + c;
  const least = Math.min(room[cell(start)], 0), cost = new Float64Array(rows * columns).fill(Infinity);
  let nearest = rows ** 2 + columns ** 2, last = start;
  for (let r = 0; r < rows; r += 1) {
    for (let c = 0; c < columns; c += 1) {
      const square = (r - end[0]) ** 2 + (c - end[1]) ** 2;
      if (room[cell([r, c])] >= 0 && square < nearest) [nearest, last] = [square, [r, c]];
    }
  }
  if (cell(last) === cell(start)) return [];
  cost[cell(last)] = 0;
  for (let round = 0; round < ROUNDS && sweep(grid, least, cost); round += 1);
  if (cost[cell(start)] === Infinity) return [];
  const corners = [start];
  let at = start;
  while (cost[cell(at)] > 0) {
    let shortest = Infinity, next = at;
    STEPS.forEach(([dr, dc], k) => {
      const y = at[0] + dr, x = at[1] + dc;
      if (y < 0 || y >= rows || x < 0 || x >= columns) return;
      const whole = cost[cell([y, x])] + (k < 4 ? 1 : DIAGONAL);
      if (whole < shortest - 1e-9) [shortest, next] = [whole, [y, x]];
    });
    if (cost[cell(next)] >= cost[cell(at)]) return [];
    if (!sees(grid, least, corners[corners.length - 1], next)) corners.push(at);
    at = next;
  }
  return [...corners, at];
}
