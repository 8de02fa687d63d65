// MotionChunks to numbers, by the core of wayfarer-client.

import { frameBytes, unpackPoses } from "wayfarer-client/core";

const COLUMNS = {
  alias: "aliases", seq: "seqs", firstFrame: "firstFrames", scheduledAtUs: "scheduledAtUs",
  goalRevision: "goalRevisions", state: "states", flags: "flags", waypoint: "waypoints",
  candidates: "candidates",
};

/**
 * The chunks of a batch, `batch.chunks`, one by one: [{ alias, seq, firstFrame, scheduledAtUs, goalRevision, state,
 * flags, waypoint, candidates, frames, contacts }]. A frame is a Float32Array: hips x, y, z, then x, y, z, w for each of
 * `header.bones`; `contacts` has a byte per frame: 1 left foot, 2 right foot. None when there are none. Throws when the
 * encoding is not known, and when the message does not hold what it should.
 */
export function unpackChunks(chunks, header) {
  const count = chunks?.aliases.length ?? 0;
  if (!count) return [];
  const bones = header.bones.length;
  const size = frameBytes(header.poseEncoding, bones);
  const { poses, contacts } = chunks;
  const each = contacts.length / count;
  const columns = Object.entries(COLUMNS).map(([name, column]) => [name, chunks[column]]);
  if (!Number.isInteger(each) || columns.some(([, { length }]) => length !== count)) {
    throw new Error(`the columns of a batch of ${count} chunks are not of one length`);
  }
  if (poses.length !== size * contacts.length) {
    throw new Error(`${poses.length} bytes of poses are not ${contacts.length} frames of ${size} bytes`);
  }
  const width = 3 + 4 * bones;
  const all = new Float32Array(width * contacts.length);
  const view = new DataView(poses.buffer, poses.byteOffset, poses.length);
  unpackPoses(view, 0, contacts.length, header.poseEncoding, bones, all);
  const frames = Array.from(contacts, (_, frame) => all.subarray(width * frame, width * (frame + 1)));
  return chunks.aliases.map((_, row) => ({
    ...Object.fromEntries(columns.map(([name, values]) => [name, values[row]])),
    frames: frames.slice(each * row, each * (row + 1)),
    contacts: contacts.subarray(each * row, each * (row + 1)),
  }));
}
