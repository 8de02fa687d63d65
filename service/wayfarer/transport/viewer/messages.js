// StreamMotionResponse (proto/wayfarer/v1/motion.proto) to plain objects. No DOM.

import { ProtoReader } from "./protobuf.js";

const STATES = ["unknown", "standing", "walking", "stopping", "turning"];
const GENDERS = ["female", "female", "male"];
const FLOATS_PER_BONE = 4;

export const FLAG = Object.freeze({ FIRST: 1, REPLANNED: 2, ARRIVED: 4, GAP: 8, REDUCED: 16 });

/** Decode one message: { sentAt, header | batch | heartbeat }, times in seconds since 1970. */
export function decodeStreamMessage(bytes) {
  const reader = new ProtoReader(bytes);
  const message = { sentAt: 0 };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) message.sentAt = reader.varint() / 1e6;
    else if (field === 2) message.header = decodeHeader(reader.message());
    else if (field === 3) message.batch = decodeBatch(reader.message());
    else if (field === 4) message.heartbeat = reader.block().length >= 0;
    else reader.skip();
  }
  return message;
}

function decodeHeader(reader) {
  const header = { serverVersion: "", sessionId: "", fps: 0, bones: [], posedBones: 0, encoding: 0 };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) header.serverVersion = reader.string();
    else if (field === 2) header.sessionId = reader.string();
    else if (field === 3) header.fps = reader.varint();
    else if (field === 5) decodeSkeleton(reader.message(), header);
    else if (field === 6) header.encoding = reader.varint();
    else reader.skip();
  }
  return header;
}

function decodeSkeleton(reader, header) {
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) header.bones.push(decodeBone(reader.message()));
    else if (field === 2) header.posedBones = reader.varint();
    else reader.skip();
  }
}

function decodeBone(reader) {
  const bone = { name: "", parent: 0 };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) bone.name = reader.string();
    else if (field === 2) bone.parent = reader.int32();
    else reader.skip();
  }
  return bone;
}

function decodeBatch(reader) {
  const batch = { added: [], chunks: [], removed: [] };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) batch.added.push(decodeAgent(reader.message()));
    else if (field === 2) batch.chunks.push(decodeChunk(reader.message()));
    else if (field === 3) reader.varints(batch.removed);
    else reader.skip();
  }
  return batch;
}

function decodeAgent(reader) {
  const agent = { id: "", alias: 0, name: "", body: "", gender: "female", betas: [], seed: 0 };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) agent.id = reader.string();
    else if (field === 2) agent.alias = reader.varint();
    else if (field === 4) agent.name = reader.string();
    else if (field === 5) agent.body = reader.string();
    else if (field === 6) agent.gender = GENDERS[reader.varint()] ?? "female";
    else if (field === 7) reader.numbers(8, agent.betas);
    else if (field === 8) agent.seed = reader.varint();
    else reader.skip();
  }
  return agent;
}

function decodeChunk(reader) {
  const chunk = {
    alias: 0, seq: 0, firstFrame: 0, scheduledAt: 0, goalRevision: 0, state: "unknown", flags: 0,
    waypoint: 0, candidates: 0, poses: new Uint8Array(0), contacts: new Uint8Array(0),
  };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) chunk.alias = reader.varint();
    else if (field === 2) chunk.seq = reader.varint();
    else if (field === 3) chunk.firstFrame = reader.varint();
    else if (field === 4) chunk.scheduledAt = reader.varint() / 1e6;
    else if (field === 5) chunk.goalRevision = reader.varint();
    else if (field === 6) chunk.state = STATES[reader.varint()] ?? "unknown";
    else if (field === 7) chunk.flags = reader.varint();
    else if (field === 8) chunk.poses = reader.block();
    else if (field === 9) chunk.contacts = reader.block();
    else if (field === 10) chunk.waypoint = reader.varint();
    else if (field === 11) chunk.candidates = reader.varint();
    else reader.skip();
  }
  return chunk;
}

/**
 * Frames of a chunk: an array of Float32Array, each hips x, y, z and then x, y, z, w per bone
 * (POSE_ENCODING_F32_LE). Throws when the length is not a whole number of frames.
 */
export function unpackPoses(bytes, posedBones) {
  const floats = 3 + FLOATS_PER_BONE * posedBones;
  if (bytes.length % (4 * floats)) {
    throw new Error(`poses of ${bytes.length} bytes are not whole frames of ${4 * floats} bytes`);
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const frames = [];
  for (let start = 0; start < bytes.length; start += 4 * floats) {
    const frame = new Float32Array(floats);
    for (let k = 0; k < floats; k += 1) frame[k] = view.getFloat32(start + 4 * k, true);
    frames.push(frame);
  }
  return frames;
}
