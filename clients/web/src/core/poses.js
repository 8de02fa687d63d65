// Packed frames to numbers; docs/wire-format.md shows each encoding byte by byte. Allocates nothing.

export const ENCODING = Object.freeze({ F32_LE: 1, SMALLEST_THREE: 3, ROOT: 4 });

const MIDDLE = 16383; // the count that stands for 0
const STEP = 1 / (MIDDLE * Math.SQRT2);

/** Bytes of a frame. Throws when the encoding is not known. @param {number} encoding @param {number} bones */
export function frameBytes(encoding, bones) {
  if (encoding === ENCODING.F32_LE) return 12 + 16 * bones;
  if (encoding === ENCODING.SMALLEST_THREE) return 12 + 6 * bones;
  if (encoding === ENCODING.ROOT) return 16;
  throw new Error(`pose encoding ${encoding} is not known: this client is older than the server`);
}

/**
 * Reads `count` frames that begin at byte `start` into `out`, each hips x, y, z and then x, y, z, w per bone.
 * @param {DataView} view @param {number} start @param {number} count
 * @param {number} encoding @param {number} bones @param {Float32Array} out
 */
export function unpackPoses(view, start, count, encoding, bones, out) {
  const width = 3 + 4 * bones;
  const rotation = (frameBytes(encoding, bones) - 12) / bones;
  let from = start;
  for (let frame = 0; frame < count; frame += 1) {
    let to = width * frame;
    for (let k = 0; k < 3; k += 1) out[to + k] = view.getFloat32(from + 4 * k, true);
    from += 12;
    to += 3;
    for (let bone = 0; bone < bones; bone += 1) {
      if (encoding === ENCODING.F32_LE) readFloats(view, from, out, to);
      else readSmallest(view, from, out, to);
      from += rotation;
      to += 4;
    }
  }
}

/** @param {DataView} view @param {number} at @param {Float32Array} out @param {number} to */
function readFloats(view, at, out, to) {
  for (let k = 0; k < 4; k += 1) out[to + k] = view.getFloat32(at + 4 * k, true);
}

/** @param {DataView} view @param {number} at @param {Float32Array} out @param {number} to */
function readSmallest(view, at, out, to) {
  const first = view.getUint16(at, true);
  const second = view.getUint16(at + 2, true);
  const leftOut = (first >> 15) | ((second >> 15) << 1);
  const a = ((first & 0x7fff) - MIDDLE) * STEP;
  const b = ((second & 0x7fff) - MIDDLE) * STEP;
  const c = ((view.getUint16(at + 4, true) & 0x7fff) - MIDDLE) * STEP;
  const d = Math.sqrt(Math.max(0, 1 - a * a - b * b - c * c));
  out[to] = leftOut === 0 ? d : a;
  out[to + 1] = leftOut === 1 ? d : leftOut === 0 ? a : b;
  out[to + 2] = leftOut === 2 ? d : leftOut === 3 ? c : b;
  out[to + 3] = leftOut === 3 ? d : c;
}
