// StreamMotionResponse (proto/wayfarer/v1/motion.proto) to plain objects. No DOM.

import { ProtoReader } from "./protobuf.js";

const STATES = ["unknown", "standing", "walking", "stopping", "turning"];
const GENDERS = ["female", "female", "male"];
const EVENTS = [
  "unknown", "goal_reached", "path_done", "gap", "draining", "model_changed", "unreachable", "blocked", "goal_moved",
  "behaviour_ended",
];

export const FLAG = Object.freeze({ FIRST: 1, REPLANNED: 2, ARRIVED: 4, GAP: 8, REDUCED: 16, HELD: 32 });

/** Decode one message: { sentAt, header | batch | heartbeat | event }, times in seconds since 1970. */
export function decodeStreamMessage(bytes) {
  const reader = new ProtoReader(bytes);
  const message = { sentAt: 0 };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) message.sentAt = reader.varint() / 1e6;
    else if (field === 2) message.header = decodeHeader(reader.message());
    else if (field === 3) message.batch = decodeBatch(reader.message());
    else if (field === 4) message.heartbeat = reader.block().length >= 0;
    else if (field === 5) message.event = decodeEvent(reader.message());
    else reader.skip();
  }
  return message;
}

function decodeHeader(reader) {
  const header = {
    serverVersion: "", sessionId: "", fps: 0, sentFps: 0, skeleton: [], bones: [], encoding: 0,
    frameBytes: 0, resumed: false,
  };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) header.serverVersion = reader.string();
    else if (field === 2) header.sessionId = reader.string();
    else if (field === 3) header.fps = reader.varint();
    else if (field === 5) decodeSkeleton(reader.message(), header);
    else if (field === 6) header.encoding = reader.varint();
    else if (field === 7) header.sentFps = reader.varint();
    else if (field === 8) reader.varints(header.bones);
    else if (field === 9) header.frameBytes = reader.varint();
    else if (field === 11) header.resumed = reader.varint() !== 0;
    else reader.skip();
  }
  return header;
}

function decodeSkeleton(reader, header) {
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) header.skeleton.push(decodeBone(reader.message()));
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
  const batch = { added: [], chunks: [], removed: [], resumeToken: "" };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) batch.added.push(decodeAgent(reader.message()));
    else if (field === 2) batch.chunks = decodeChunks(reader.message());
    else if (field === 3) reader.varints(batch.removed);
    else if (field === 4) batch.resumeToken = reader.string();
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

const COLUMNS = { // of MotionChunks, those with a number for each chunk
  1: "alias", 2: "seq", 3: "firstFrame", 4: "scheduledAt", 5: "goalRevision", 6: "state", 7: "flags",
  10: "waypoint", 11: "candidates",
};

/** The chunks, one object each; their poses and contacts are views. */
function decodeChunks(reader) {
  const columns = Object.fromEntries(Object.values(COLUMNS).map((name) => [name, []]));
  let poses = new Uint8Array(0);
  let contacts = new Uint8Array(0);
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 8) poses = reader.block();
    else if (field === 9) contacts = reader.block();
    else if (COLUMNS[field]) reader.varints(columns[COLUMNS[field]]);
    else reader.skip();
  }
  const count = columns.alias.length;
  const sizes = [poses.length / (count || 1), contacts.length / (count || 1)];
  if (Object.values(columns).some(({ length }) => length !== count) || !sizes.every(Number.isInteger)) {
    throw new Error("malformed message: columns of chunks differ in length");
  }
  const part = (bytes, size, row) => bytes.subarray(size * row, size * (row + 1));
  return columns.alias.map((_, row) => {
    const chunk = Object.fromEntries(Object.entries(columns).map(([name, values]) => [name, values[row]]));
    chunk.scheduledAt /= 1e6;
    chunk.state = STATES[chunk.state] ?? "unknown";
    return { ...chunk, poses: part(poses, sizes[0], row), contacts: part(contacts, sizes[1], row) };
  });
}

function decodeEvent(reader) {
  const event = { kind: "unknown", agentId: "", alias: 0, at: 0, goalRevision: 0, waypoint: 0, detail: "" };
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) event.kind = EVENTS[reader.varint()] ?? "unknown";
    else if (field === 2) event.agentId = reader.string();
    else if (field === 3) event.alias = reader.varint();
    else if (field === 4) event.at = reader.varint() / 1e6;
    else if (field === 5) event.goalRevision = reader.varint();
    else if (field === 6) event.waypoint = reader.varint();
    else if (field === 7) event.detail = reader.string();
    else reader.skip();
  }
  return event;
}
