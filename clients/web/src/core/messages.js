// StreamMotionResponse (proto/wayfarer/v1/motion.proto), read from bytes. Times are seconds since 1970.

import { ENCODING, frameBytes } from "./poses.js";
import { Column, ProtoReader } from "./protobuf.js";

const STATES = ["unknown", "standing", "walking", "stopping", "turning"];
/** @type {("female" | "male")[]} */
const GENDERS = ["female", "female", "male"];
const BASIS_NAMES = ["gltf", "gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros"];
const EVENTS = [
  "unknown", "goal_reached", "path_done", "gap", "draining", "model_changed", "unreachable", "blocked", "goal_moved",
  "behaviour_ended", "agent_left", "fault",
];

/** Flags of a chunk; `flags` is a sum of them. */
export const FLAG = Object.freeze({ FIRST: 1, REPLANNED: 2, ARRIVED: 4, GAP: 8, REDUCED: 16, HELD: 32 });

/**
 * Properties of a whole stream. `bones`: numbers in `skeleton` of the bones whose rotations are sent.
 * @typedef {object} Header
 * @property {string} serverVersion @property {string} sessionId
 * @property {number} fps frames per second of the motion @property {number} sentFps frames sent per second
 * @property {string} basis its name, as in the API @property {number} metresPerUnit
 * @property {{ name: string, parent: number }[]} skeleton @property {number[]} bones
 * @property {number} encoding @property {number} frameBytes @property {boolean} resumed
 * @property {Tier[]} tiers how frames are packed in each ring, from the inside out; one if there are no rings
 */
/**
 * @typedef {object} Tier
 * @property {number} radius Infinity without rings @property {number} encoding @property {number} sentFps
 * @property {number[]} bones @property {number} frameBytes
 */
/**
 * An agent, as the stream introduces it. `restOffsets`: x, y, z for each bone of the skeleton.
 * @typedef {object} Agent
 * @property {string} id @property {number} alias @property {string} name @property {string} body
 * @property {"female" | "male"} gender @property {number[]} betas @property {number} seed
 * @property {number[]} restOffsets @property {string} outfit its clothes
 */
/**
 * The new frames of an agent.
 * @typedef {object} Chunk
 * @property {number} alias @property {number} seq @property {number} firstFrame @property {number} scheduledAt
 * @property {number} goalRevision @property {string} state @property {number} flags @property {number} waypoint
 * @property {number} candidates @property {number} frames how many
 * @property {number} poses where they begin in the decoder's `bytes` @property {number} contacts
 */
/**
 * @typedef {object} MotionEvent
 * @property {string} kind @property {string} agentId @property {number} alias @property {number} at
 * @property {number} goalRevision @property {number} waypoint @property {string} detail
 */
/** @typedef {"" | "header" | "batch" | "heartbeat" | "event"} Kind */

/** A chunk. Its time is in an array, since a property would be boxed each time. @implements {Chunk} */
class ChunkRow {
  alias = 0; seq = 0; firstFrame = 0; scheduledAt = 0; goalRevision = 0; state = ""; flags = 0; waypoint = 0;
  candidates = 0; frames = 0; poses = 0; contacts = 0;
  time = new Float64Array(1);

  constructor() {
    const { time } = this;
    Object.defineProperty(this, "time", { enumerable: false });
    Object.defineProperty(this, "scheduledAt", { get: () => time[0], enumerable: true });
  }
}

/** Reads messages, and holds the last one. A batch that introduces no agent allocates nothing. */
export class StreamDecoder {
  #reader = new ProtoReader();
  #columns = { // columns of MotionChunks with a number for each chunk, by field
    alias: new Column(), seq: new Column(), firstFrame: new Column(), scheduledAt: new Column(true),
    goalRevision: new Column(), state: new Column(), flags: new Column(), waypoint: new Column(),
    candidates: new Column(),
  };
  #all = Object.values(this.#columns);
  #poses = 0;
  #posesLength = 0;
  #contacts = 0;
  #contactsLength = 0;
  #removed = new Column();
  #hidden = new Column();
  #token = new Uint8Array(64);
  #tokenLength = 0;
  #chunk = new ChunkRow();

  constructor() {
    /** @type {Kind} */
    this.kind = "";
    /** The server's clock when it sent the message. */
    this.sentAt = 0.5;
    /** @type {Header | null} */
    this.header = null;
    /** @type {MotionEvent | null} */
    this.event = null;
    /** Agents seen for the first time. @type {Agent[]} */
    this.added = [];
    /** Chunks of the batch. */
    this.chunks = 0;
    /** Agents that were deleted. */
    this.removed = 0;
    /** Agents that have left the last ring. */
    this.hidden = 0;
    /** Tier of the chunks: index into the header's `tiers`. */
    this.tier = 0;
  }

  /** The message's bytes, in which `poses` and `contacts` of a chunk are places. */
  get bytes() {
    return this.#reader.bytes;
  }

  /** The same, to read numbers. */
  get view() {
    return this.#reader.view;
  }

  /** Resume token of the last batch that had one: everything up to it has come. */
  get resumeToken() {
    return new TextDecoder().decode(this.#token.subarray(0, this.#tokenLength));
  }

  /** Reads a message. Throws when it is malformed. @param {Uint8Array} message @returns {Kind} */
  decode(message) {
    const reader = this.#reader;
    reader.load(message);
    this.kind = "";
    this.sentAt = 0;
    this.header = null;
    this.event = null;
    this.added.length = 0;
    this.#removed.length = 0;
    this.#hidden.length = 0;
    this.tier = 0;
    for (let k = 0; k < this.#all.length; k += 1) this.#all[k].length = 0;
    this.#posesLength = this.#contactsLength = 0;
    for (let field = reader.next(); field; field = reader.next()) {
      if (field === 1) this.sentAt = reader.varint() / 1e6;
      else if (field === 3) this.#batch();
      else if (field === 2) this.header = readHeader(reader);
      else if (field === 4) reader.block();
      else if (field === 5) this.event = readEvent(reader);
      else reader.skip();
      if (field > 1 && field < 6) this.kind = field === 3 ? "batch" : field === 2 ? "header" : field === 5 ? "event" : "heartbeat";
    }
    this.#check();
    return this.kind;
  }

  /** Chunk `row` of the batch: one object, overwritten by each call. @param {number} row */
  chunk(row) {
    const chunk = this.#chunk, columns = this.#columns;
    chunk.alias = columns.alias.values[row];
    chunk.seq = columns.seq.values[row];
    chunk.firstFrame = columns.firstFrame.values[row];
    chunk.time[0] = columns.scheduledAt.values[row] / 1e6;
    chunk.goalRevision = columns.goalRevision.values[row];
    chunk.state = STATES[columns.state.values[row]] ?? "unknown";
    chunk.flags = columns.flags.values[row];
    chunk.waypoint = columns.waypoint.values[row];
    chunk.candidates = columns.candidates.values[row];
    chunk.frames = (this.#contactsLength / this.chunks) | 0;
    chunk.poses = this.#poses + ((this.#posesLength / this.chunks) | 0) * row;
    chunk.contacts = this.#contacts + chunk.frames * row;
    return chunk;
  }

  /** Alias of removed agent `row`. @param {number} row */
  removedAlias(row) {
    return this.#removed.values[row];
  }

  /** Alias of hidden agent `row`. @param {number} row */
  hiddenAlias(row) {
    return this.#hidden.values[row];
  }

  /** Throws unless the chunks of the batch are whole frames of their tier. @param {Header} header */
  checkFrames({ tiers }) {
    if (this.tier >= tiers.length) throw new Error(`the header tells of ${tiers.length} tiers, not of ${this.tier}`);
    const { encoding, bones } = tiers[this.tier];
    const each = frameBytes(encoding, bones.length);
    if (this.#posesLength !== each * this.#contactsLength) {
      throw new Error(`${this.#posesLength} bytes of poses are not ${this.#contactsLength} frames of ${each} bytes`);
    }
  }

  #batch() {
    const reader = this.#reader;
    const outer = reader.enter();
    for (let field = reader.next(); field; field = reader.next()) {
      if (field === 2) this.#chunks();
      else if (field === 1) this.added.push(readAgent(reader));
      else if (field === 3) reader.varints(this.#removed);
      else if (field === 4) this.#keepToken(reader.block());
      else if (field === 5) this.tier = reader.varint();
      else if (field === 6) reader.varints(this.#hidden);
      else reader.skip();
    }
    reader.leave(outer);
  }

  #chunks() {
    const reader = this.#reader, columns = this.#columns;
    const outer = reader.enter();
    for (let field = reader.next(); field; field = reader.next()) {
      if (field === 1) reader.varints(columns.alias);
      else if (field === 2) reader.varints(columns.seq);
      else if (field === 3) reader.varints(columns.firstFrame);
      else if (field === 4) reader.varints(columns.scheduledAt);
      else if (field === 5) reader.varints(columns.goalRevision);
      else if (field === 6) reader.varints(columns.state);
      else if (field === 7) reader.varints(columns.flags);
      else if (field === 10) reader.varints(columns.waypoint);
      else if (field === 11) reader.varints(columns.candidates);
      else if (field === 8) {
        this.#posesLength = reader.block();
        this.#poses = reader.at - this.#posesLength;
      } else if (field === 9) {
        this.#contactsLength = reader.block();
        this.#contacts = reader.at - this.#contactsLength;
      } else reader.skip();
    }
    reader.leave(outer);
  }

  #check() {
    this.chunks = this.#columns.alias.length;
    this.removed = this.#removed.length;
    this.hidden = this.#hidden.length;
    const count = this.chunks || 1;
    for (let k = 0; k < this.#all.length; k += 1) {
      if (this.#all[k].length !== this.chunks) throw new Error("malformed message: columns of chunks differ in length");
    }
    if (this.#posesLength % count || this.#contactsLength % count) {
      throw new Error("malformed message: columns of chunks differ in length");
    }
  }

  /** @param {number} length */
  #keepToken(length) {
    if (length > this.#token.length) this.#token = new Uint8Array(2 * length);
    const { bytes, at } = this.#reader;
    for (let k = 0; k < length; k += 1) this.#token[k] = bytes[at - length + k];
    this.#tokenLength = length;
  }
}

/** @param {ProtoReader} reader @returns {Header} */
function readHeader(reader) {
  /** @type {Header} */
  const header = {
    serverVersion: "", sessionId: "", fps: 0, sentFps: 0, basis: "gltf", metresPerUnit: 1,
    skeleton: [], bones: [], encoding: 0, frameBytes: 0, resumed: false, tiers: [],
  };
  const outer = reader.enter();
  const bones = new Column();
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) header.serverVersion = reader.string();
    else if (field === 2) header.sessionId = reader.string();
    else if (field === 3) header.fps = reader.varint();
    else if (field === 4) readBasis(reader, header);
    else if (field === 5) readSkeleton(reader, header.skeleton);
    else if (field === 6) header.encoding = reader.varint();
    else if (field === 7) header.sentFps = reader.varint();
    else if (field === 8) reader.varints(bones);
    else if (field === 9) header.frameBytes = reader.varint();
    else if (field === 11) header.resumed = reader.varint() !== 0;
    else if (field === 12) header.tiers.push(readTier(reader));
    else reader.skip();
  }
  reader.leave(outer);
  header.bones = [...bones.values.subarray(0, bones.length)];
  const { encoding, sentFps, frameBytes } = header;
  if (!header.tiers.length) header.tiers.push({ radius: Infinity, encoding, sentFps, bones: header.bones, frameBytes });
  if (encoding === ENCODING.ROOT) header.bones = Array.from({ length: 22 }, (_, bone) => bone);
  return header;
}

/** @param {ProtoReader} reader @returns {Tier} */
function readTier(reader) {
  const tier = { radius: 0, encoding: 0, sentFps: 0, bones: [0], frameBytes: 0 };
  const bones = new Column();
  const outer = reader.enter();
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) tier.radius = reader.double();
    else if (field === 2) tier.encoding = reader.varint();
    else if (field === 3) tier.sentFps = reader.varint();
    else if (field === 4) reader.varints(bones);
    else if (field === 5) tier.frameBytes = reader.varint();
    else reader.skip();
  }
  reader.leave(outer);
  tier.bones = [...bones.values.subarray(0, bones.length)];
  return tier;
}

/** @param {ProtoReader} reader @param {Header} header */
function readBasis(reader, header) {
  const outer = reader.enter();
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) header.basis = BASIS_NAMES[reader.varint()] ?? "unknown";
    else if (field === 2) header.metresPerUnit = reader.double();
    else reader.skip();
  }
  reader.leave(outer);
}

/** @param {ProtoReader} reader @param {Header["skeleton"]} skeleton */
function readSkeleton(reader, skeleton) {
  const outer = reader.enter();
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) skeleton.push(readBone(reader));
    else reader.skip();
  }
  reader.leave(outer);
}

/** @param {ProtoReader} reader */
function readBone(reader) {
  const bone = { name: "", parent: 0 };
  const outer = reader.enter();
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) bone.name = reader.string();
    else if (field === 2) bone.parent = reader.int32();
    else reader.skip();
  }
  reader.leave(outer);
  return bone;
}

/** @param {ProtoReader} reader @returns {Agent} */
function readAgent(reader) {
  /** @type {Agent} */
  const agent = { id: "", alias: 0, name: "", body: "", gender: "female", betas: [], seed: 0, restOffsets: [], outfit: "" };
  const outer = reader.enter();
  for (let field = reader.next(); field; field = reader.next()) {
    if (field === 1) agent.id = reader.string();
    else if (field === 2) agent.alias = reader.varint();
    else if (field === 4) agent.name = reader.string();
    else if (field === 5) agent.body = reader.string();
    else if (field === 6) agent.gender = GENDERS[reader.varint()] ?? "female";
    else if (field === 7) reader.floats(8, agent.betas);
    else if (field === 8) agent.seed = reader.varint();
    else if (field === 15) reader.floats(4, agent.restOffsets);
    else if (field === 20) agent.outfit = reader.string();
    else reader.skip();
  }
  reader.leave(outer);
  return agent;
}

/** @param {ProtoReader} reader @returns {MotionEvent} */
function readEvent(reader) {
  const event = { kind: "unknown", agentId: "", alias: 0, at: 0, goalRevision: 0, waypoint: 0, detail: "" };
  const outer = reader.enter();
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
  reader.leave(outer);
  return event;
}
