// A made-up stream: people who walk, as a server would send them.

import { golden } from "./golden.js";

const { walk } = golden("retarget.json");
const { rest_offsets: OFFSETS, hips: HIPS, rotations: ROTATIONS } = walk.gltf;

/** Bytes of a varint. */
function varint(value) {
  const bytes = [];
  for (let rest = value; ; rest = Math.floor(rest / 128)) {
    if (rest < 128) return [...bytes, rest];
    bytes.push((rest % 128) + 128);
  }
}

function joined(...pieces) {
  const all = new Uint8Array(pieces.reduce((length, piece) => length + piece.length, 0));
  pieces.reduce((start, piece) => (all.set(piece, start), start + piece.length), 0);
  return all;
}

const block = (field, bytes) => joined(varint(field * 8 + 2), varint(bytes.length), bytes);
const number = (field, value) => [...varint(field * 8), ...varint(value)];
const packed = (field, values) => block(field, values.flatMap(varint));
const text = (field, value) => block(field, new TextEncoder().encode(value));
const floats = (values) => new Uint8Array(Float32Array.from(values).buffer);

const TURNED = ROTATIONS.map((rotations) => rotations.flat());

/** The first message: 22 bones in F32_LE at 40 fps. */
export function header() {
  const bones = Array.from({ length: 22 }, (_, k) => k);
  const fields = joined(
    number(3, 40), block(4, number(1, 1)), number(6, 1), number(7, 40), packed(8, bones), number(9, 364),
  );
  return joined(number(1, 1e15), block(2, fields));
}

/** Batch `seq` of `count` agents: 8 frames of each. The first introduces them, or another that is to. */
export function batch(count, seq, introduces = seq === 0) {
  const at = 1e15 + 200_000 * seq;
  const aliases = Array.from({ length: count }, (_, k) => k + 1);
  const poses = new Float32Array(count * 8 * (3 + TURNED[0].length));
  let filled = 0;
  for (const alias of aliases) {
    for (let f = 0; f < 8; f += 1) {
      const shown = (seq + f + alias) % HIPS.length;
      const [x, y, z] = HIPS[shown];
      poses.set([x + alias, y, z], filled);
      poses.set(TURNED[shown], filled + 3);
      filled += 3 + TURNED[shown].length;
    }
  }
  const all = (value) => aliases.map(() => value);
  const chunks = joined(
    packed(1, aliases), packed(2, all(seq)), packed(3, all(8 * seq)), packed(4, all(at)), packed(5, all(1)),
    packed(6, all(2)), packed(7, all(0)), packed(10, all(0)), packed(11, all(1)), block(8, new Uint8Array(poses.buffer)),
    block(9, aliases.flatMap(() => [1, 1, 1, 3, 2, 2, 2, 3])),
  );
  const added = !introduces ? [] : aliases.map((alias) => block(1, joined(
    text(1, `agent-${alias}`), number(2, alias), block(15, floats(OFFSETS.flat())),
  )));
  return joined(number(1, at), block(3, joined(...added, block(2, chunks), text(4, `epoch.${seq}`))));
}
