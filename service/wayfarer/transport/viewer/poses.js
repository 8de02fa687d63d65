// Packed frames to numbers; docs/wire-format.md shows each encoding byte by byte. No DOM.

export const ENCODING = Object.freeze({ F32_LE: 1, F16_LE: 2, SMALLEST_THREE: 3 });

const ROTATION_BYTES = { [ENCODING.F32_LE]: 16, [ENCODING.F16_LE]: 8, [ENCODING.SMALLEST_THREE]: 6 };
const MIDDLE = 16383; // the count that stands for 0
const STEP = 1 / (MIDDLE * Math.SQRT2);
const OTHERS = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]; // by the component left out

/**
 * Frames of a chunk: an array of Float32Array, each hips x, y, z and then x, y, z, w per bone.
 * `layout` has `encoding` and `bones` (how many rotations a frame has). Throws when the encoding is
 * not known or the bytes are not whole frames.
 */
export function unpackPoses(bytes, { encoding, bones }) {
  const rotationBytes = ROTATION_BYTES[encoding];
  if (!rotationBytes) throw new Error(`pose encoding ${encoding} is not known`);
  const frameBytes = 12 + rotationBytes * bones;
  if (bytes.length % frameBytes) {
    throw new Error(`poses of ${bytes.length} bytes are not whole frames of ${frameBytes} bytes`);
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const read = { [ENCODING.F32_LE]: readFloats, [ENCODING.F16_LE]: readHalves, [ENCODING.SMALLEST_THREE]: readSmallest }[encoding];
  const frames = [];
  for (let start = 0; start < bytes.length; start += frameBytes) {
    const frame = new Float32Array(3 + 4 * bones);
    for (let k = 0; k < 3; k += 1) frame[k] = view.getFloat32(start + 4 * k, true);
    for (let bone = 0; bone < bones; bone += 1) {
      read(view, start + 12 + rotationBytes * bone, frame, 3 + 4 * bone);
    }
    frames.push(frame);
  }
  return frames;
}

function readFloats(view, at, frame, to) {
  for (let k = 0; k < 4; k += 1) frame[to + k] = view.getFloat32(at + 4 * k, true);
}

function readHalves(view, at, frame, to) {
  let squares = 0;
  for (let k = 0; k < 4; k += 1) {
    const value = half(view.getUint16(at + 2 * k, true));
    frame[to + k] = value;
    squares += value * value;
  }
  const length = Math.sqrt(squares);
  for (let k = 0; k < 4; k += 1) frame[to + k] /= length;
}

/** IEEE 754 binary16; DataView.getFloat16 is not everywhere yet. */
function half(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 0x1f;
  const fraction = bits & 0x3ff;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 0x1f) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

function readSmallest(view, at, frame, to) {
  const first = view.getUint16(at, true);
  const second = view.getUint16(at + 2, true);
  const counts = [first & 0x7fff, second & 0x7fff, view.getUint16(at + 4, true) & 0x7fff];
  const leftOut = (first >> 15) | ((second >> 15) << 1);
  let squares = 0;
  OTHERS[leftOut].forEach((component, k) => {
    const value = (counts[k] - MIDDLE) * STEP;
    frame[to + component] = value;
    squares += value * value;
  });
  frame[to + leftOut] = Math.sqrt(Math.max(0, 1 - squares));
}
