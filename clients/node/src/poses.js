// MotionChunks to numbers, by the core of wayfarer-client.

import { ENCODING, TierUnpacker, frameBytes } from "wayfarer-client/core";

const BASES = ["gltf", "gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros"];
const BODY = Array.from({ length: 22 }, (_, bone) => bone);

const COLUMNS = {
  alias: "aliases", seq: "seqs", firstFrame: "firstFrames", scheduledAtUs: "scheduledAtUs",
  goalRevision: "goalRevisions", state: "states", flags: "flags", waypoint: "waypoints",
  candidates: "candidates",
};

/**
 * The chunks of a batch, `batch.chunks`, one by one: [{ alias, seq, firstFrame, scheduledAtUs, goalRevision, state,
 * flags, waypoint, candidates, frames, contacts }]. A frame is a Float32Array: hips x, y, z, then x, y, z, w for each of
 * `header.bones` (of a stream of roots alone, bones 0 to 21); `contacts` has a byte per frame: 1 left foot, 2 right foot. None when there are none. Throws when the
 * encoding is not known, and when the message does not hold what it should. `tier`: `batch.tier`; frames of all tiers
 * have the bones of the first.
 */
export function unpackChunks(chunks, header, tier = 0) {
  const count = chunks?.aliases.length ?? 0;
  if (!count) return [];
  const unpacker = unpackerOf(header);
  if (tier >= unpacker.tiers.length) throw new Error(`the header tells of ${unpacker.tiers.length} tiers, not of ${tier}`);
  const size = frameBytes(unpacker.tiers[tier].encoding, unpacker.tiers[tier].count);
  const { poses, contacts } = chunks;
  const each = contacts.length / count;
  const columns = Object.entries(COLUMNS).map(([name, column]) => [name, chunks[column]]);
  if (!Number.isInteger(each) || columns.some(([, { length }]) => length !== count)) {
    throw new Error(`the columns of a batch of ${count} chunks are not of one length`);
  }
  if (poses.length !== size * contacts.length) {
    throw new Error(`${poses.length} bytes of poses are not ${contacts.length} frames of ${size} bytes`);
  }
  const { width } = unpacker;
  const all = new Float32Array(width * contacts.length);
  const view = new DataView(poses.buffer, poses.byteOffset, poses.length);
  unpacker.unpack(view, 0, contacts.length, tier, all);
  const frames = Array.from(contacts, (_, frame) => all.subarray(width * frame, width * (frame + 1)));
  return chunks.aliases.map((_, row) => ({
    ...Object.fromEntries(columns.map(([name, values]) => [name, values[row]])),
    frames: frames.slice(each * row, each * (row + 1)),
    contacts: contacts.subarray(each * row, each * (row + 1)),
  }));
}

const UNPACKERS = new WeakMap(); // by header

function unpackerOf(header) {
  let unpacker = UNPACKERS.get(header);
  if (!unpacker) {
    const isRoot = header.poseEncoding === ENCODING.ROOT;
    const tiers = header.tiers?.length ? header.tiers : [header];
    tiers.forEach(({ poseEncoding, bones }) => frameBytes(poseEncoding, bones.length)); // an unknown one is told
    unpacker = new TierUnpacker({
      basis: BASES[header.basis?.basis ?? 0],
      bones: isRoot ? BODY : header.bones,
      tiers: tiers.map(({ poseEncoding, sentFps, bones }) => ({ encoding: poseEncoding, sentFps, bones })),
    });
    UNPACKERS.set(header, unpacker);
  }
  return unpacker;
}
