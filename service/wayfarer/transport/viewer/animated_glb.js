// A body's GLB with motion in it. Bytes and numbers in, bytes out; no DOM, no three.js.

const JSON_CHUNK = 0x4e4f534a, BINARY_CHUNK = 0x004e4942, MAGIC = 0x46546c67;
const FLOAT = 5126;

/**
 * The file with an animation: `times` [T] in seconds from 0, `frames` [T × width] as the stream has them (hips x, y, z, then
 * x, y, z, w of each of `boneNames`). Throws when the file has not these bones.
 */
export function withMotion(glb, boneNames, times, frames, name = "motion") {
  const { document, binary } = parts(glb);
  const width = 3 + 4 * boneNames.length;
  const count = times.length;
  const pieces = [binary];
  let length = binary.length;
  const accessor = (values, type, extent = {}) => {
    document.bufferViews.push({ buffer: 0, byteOffset: length, byteLength: values.byteLength });
    pieces.push(new Uint8Array(values.buffer, values.byteOffset, values.byteLength));
    length += values.byteLength;
    const size = { SCALAR: 1, VEC3: 3, VEC4: 4 }[type];
    document.accessors.push({ bufferView: document.bufferViews.length - 1, componentType: FLOAT, count: values.length / size, type, ...extent });
    return document.accessors.length - 1;
  };
  const input = accessor(Float32Array.from(times), "SCALAR", { min: [times[0]], max: [Math.fround(times[count - 1])] });
  const samplers = [];
  const channels = [];
  const animate = (node, path, output) => {
    samplers.push({ input, output, interpolation: "LINEAR" });
    channels.push({ sampler: samplers.length - 1, target: { node, path } });
  };
  const nodeOf = new Map(document.nodes.map((node, number) => [node.name, number]));
  boneNames.forEach((bone, k) => {
    const node = nodeOf.get(bone);
    if (node === undefined) throw new Error(`the body has no bone ${bone}`);
    delete document.nodes[node].matrix; // a node with channels has none
    if (k === 0) animate(node, "translation", accessor(column(frames, width, 0, 3, count), "VEC3"));
    animate(node, "rotation", accessor(unbroken(column(frames, width, 3 + 4 * k, 4, count)), "VEC4"));
  });
  document.animations = [{ name, samplers, channels }];
  document.buffers[0].byteLength = length;
  return joined(document, pieces, length);
}

function column(frames, width, first, size, count) {
  const values = new Float32Array(count * size);
  for (let k = 0; k < count; k += 1) values.set(frames.subarray(width * k + first, width * k + first + size), size * k);
  return values;
}

/** Quaternions of which none is more than half a turn from the one before: q and -q are the same turn. */
function unbroken(turns) {
  for (let k = 4; k < turns.length; k += 4) {
    const dot = turns[k] * turns[k - 4] + turns[k + 1] * turns[k - 3] + turns[k + 2] * turns[k - 2] + turns[k + 3] * turns[k - 1];
    if (dot < 0) for (let n = k; n < k + 4; n += 1) turns[n] = -turns[n];
  }
  return turns;
}

function parts(glb) {
  const view = new DataView(glb);
  if (view.getUint32(0, true) !== MAGIC) throw new Error("this is no GLB file");
  let document = null, binary = new Uint8Array();
  for (let at = 12; at < glb.byteLength;) {
    const size = view.getUint32(at, true), kind = view.getUint32(at + 4, true);
    const bytes = new Uint8Array(glb, at + 8, size);
    if (kind === JSON_CHUNK) document = JSON.parse(new TextDecoder().decode(bytes));
    else if (kind === BINARY_CHUNK) binary = bytes;
    at += 8 + size;
  }
  return { document, binary };
}

function joined(document, pieces, length) {
  const text = new TextEncoder().encode(JSON.stringify(document));
  const textRoom = 4 * Math.ceil(text.length / 4), room = 4 * Math.ceil(length / 4);
  const glb = new Uint8Array(12 + 8 + textRoom + 8 + room);
  const view = new DataView(glb.buffer);
  [MAGIC, 2, glb.length, textRoom, JSON_CHUNK].forEach((value, k) => view.setUint32(4 * k, value, true));
  glb.fill(0x20, 20, 20 + textRoom);
  glb.set(text, 20);
  view.setUint32(20 + textRoom, room, true);
  view.setUint32(24 + textRoom, BINARY_CHUNK, true);
  let at = 28 + textRoom;
  for (const piece of pieces) {
    glb.set(piece, at);
    at += piece.length;
  }
  return glb.buffer;
}
