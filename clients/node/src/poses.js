// MotionChunks to numbers; docs/wire-format.md shows each encoding byte by byte.

import { PoseEncoding } from "./gen/wayfarer/v1/motion_pb.js";

const MIDDLE = 16383; // the count that stands for 0
const STEP = 1 / (MIDDLE * Math.SQRT2);
const OTHERS = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]; // by the component left out

const COLUMNS = {
  alias: "aliases", seq: "seqs", firstFrame: "firstFrames", scheduledAtUs: "scheduledAtUs",
  goalRevision: "goalRevisions", state: "states", flags: "flags", waypoint: "waypoints",
  candidates: "candidates",
};

const READERS = {
  [PoseEncoding.F32_LE]: { size: 16, read: readFloats },
  [PoseEncoding.F16_LE]: { size: 8, read: readHalves },
  [PoseEncoding.SMALLEST_THREE]: { size: 6, read: readSmallest },
};

/**
 * The chunks of a batch, `batch.chunks`, one by one: [{ alias, seq, firstFrame, scheduledAtUs,
 * goalRevision, state, flags, waypoint, candidates, frames, contacts }], with `frames` as of
 * `unpackPoses` and `contacts` as of `unpackContacts`. None when there are none. Throws as
 * `unpackPoses`, and when the columns of the message differ in length.
 */
export function unpackChunks(chunks, header) {
  if (!chunks?.aliases.length) return [];
  const count = chunks.aliases.length;
  const frames = unpackPoses(chunks.poses, header);
  const contacts = unpackContacts(chunks.contacts);
  const each = frames.length / count;
  const columns = Object.entries(COLUMNS).map(([name, column]) => [name, chunks[column]]);
  if (!Number.isInteger(each) || contacts.length !== frames.length || columns.some(([, { length }]) => length !== count)) {
    throw new Error(`the columns of a batch of ${count} chunks are not of one length`);
  }
  return chunks.aliases.map((_, row) => ({
    ...Object.fromEntries(columns.map(([name, values]) => [name, values[row]])),
    frames: frames.slice(each * row, each * (row + 1)),
    contacts: contacts.slice(each * row, each * (row + 1)),
  }));
}

/**
 * Frames of one chunk or several, packed as a stream's header says: [{ translation: [x, y, z], rotations:
 * [[x, y, z, w], …] }], one rotation for each of `header.bones`. Throws when the encoding is not
 * known or the bytes are not whole frames.
 */
export function unpackPoses(poses, header) {
  const reader = READERS[header.poseEncoding];
  if (!reader) throw new Error(`pose encoding ${header.poseEncoding} is not known: update this client`);
  const frameBytes = 12 + reader.size * header.bones.length;
  if (poses.length % frameBytes) {
    throw new Error(`${poses.length} bytes of poses are not whole frames of ${frameBytes} bytes`);
  }
  const bytes = Buffer.from(poses.buffer, poses.byteOffset, poses.length);
  return Array.from({ length: bytes.length / frameBytes }, (_, frame) => {
    const start = frame * frameBytes;
    return {
      translation: [0, 4, 8].map((at) => bytes.readFloatLE(start + at)),
      rotations: header.bones.map((_, bone) => reader.read(bytes, start + 12 + reader.size * bone)),
    };
  });
}

/** What touches the ground and is still, frame by frame: [{ left, right }]. */
export function unpackContacts(contacts) {
  return Array.from(contacts, (bits) => ({ left: (bits & 1) !== 0, right: (bits & 2) !== 0 }));
}

function readFloats(bytes, at) {
  return [0, 4, 8, 12].map((offset) => bytes.readFloatLE(at + offset));
}

function readHalves(bytes, at) {
  const values = [0, 2, 4, 6].map((offset) => half(bytes.readUInt16LE(at + offset)));
  const length = Math.hypot(...values);
  return values.map((value) => value / length);
}

function half(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 0x1f;
  const fraction = bits & 0x3ff;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 0x1f) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

function readSmallest(bytes, at) {
  const words = [0, 2, 4].map((offset) => bytes.readUInt16LE(at + offset));
  const leftOut = (words[0] >> 15) | ((words[1] >> 15) << 1);
  const rotation = [0, 0, 0, 0];
  OTHERS[leftOut].forEach((component, k) => {
    rotation[component] = ((words[k] & 0x7fff) - MIDDLE) * STEP;
  });
  rotation[leftOut] = Math.sqrt(Math.max(0, 1 - rotation.reduce((sum, value) => sum + value * value, 0)));
  return rotation;
}
