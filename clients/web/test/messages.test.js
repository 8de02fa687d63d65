import assert from "node:assert/strict";
import { test } from "node:test";
import { FLAG, MotionPlayer, StreamDecoder, unpackPoses } from "../src/core/index.js";
import { ProtoReader } from "../src/core/protobuf.js";
import { golden } from "./golden.js";

const MESSAGES = golden("messages.json");
const bytes = (name) => new Uint8Array(Buffer.from(MESSAGES[name], "hex"));

function decoded(message) {
  const decoder = new StreamDecoder();
  decoder.decode(message);
  return decoder;
}

function frames(decoder, row, { encoding, bones }) {
  const chunk = decoder.chunk(row);
  const out = new Float32Array(chunk.frames * (3 + 4 * bones));
  unpackPoses(decoder.view, chunk.poses, chunk.frames, encoding, bones, out);
  return out;
}

test("a header gives rate, basis, skeleton and encoding", () => {
  const { kind, sentAt, header } = decoded(bytes("header"));
  assert.deepEqual([kind, sentAt], ["header", 1_780_000_000.2]);
  assert.deepEqual(header, {
    serverVersion: "1.2.3", sessionId: "s-1", fps: 40, sentFps: 40, basis: "gltf", metresPerUnit: 1, encoding: 1,
    frameBytes: 44, skeleton: [{ name: "pelvis", parent: -1 }, { name: "left_hip", parent: 0 }], bones: [0, 1],
    resumed: false, tiers: [{ radius: Infinity, encoding: 1, sentFps: 40, bones: [0, 1], frameBytes: 44 }],
  });
  const small = decoded(bytes("header_small")).header;
  assert.deepEqual([small.encoding, small.sentFps, small.bones, small.frameBytes, small.resumed], [3, 10, [1], 18, true]);
});

test("a batch gives new agents, chunks and removals", () => {
  const decoder = decoded(bytes("batch"));
  assert.deepEqual(decoder.added, [{
    id: "a-7", alias: 300, name: "Zoë", body: "anny52", gender: "male", betas: [0.5, -1.25, 3], seed: 4294967295,
    restOffsets: [0, 1, 2], outfit: "",
  }]);
  assert.deepEqual([decoder.removed, decoder.removedAlias(0), decoder.removedAlias(1)], [2, 1, 300]);
  assert.equal(decoder.resumeToken, "r.1.41");
  const { poses, contacts, ...first } = decoder.chunk(0);
  assert.deepEqual(first, {
    alias: 300, seq: 12, firstFrame: 96, scheduledAt: 1_780_000_000.123456, goalRevision: 3, frames: 3,
    state: "walking", flags: FLAG.FIRST | FLAG.ARRIVED, waypoint: 2, candidates: 8,
  });
  assert.deepEqual([...decoder.bytes.subarray(contacts, contacts + 3)], [1, 3, 2]);
  assert.deepEqual([...frames(decoder, 0, { encoding: 1, bones: 2 }).subarray(22)], [2, 2.5, 2.25, 0, 0, 0, 1, 0.5, -0.5, 0.5, -0.5]);
  const { alias, seq, state, scheduledAt } = decoder.chunk(1);
  assert.deepEqual([alias, seq, state, scheduledAt], [7, 0, "standing", 1_780_000_000.148456]);
  assert.equal(frames(decoder, 1, { encoding: 1, bones: 2 })[0], 3);
});

test("smallest-three poses and held motion", () => {
  const decoder = decoded(bytes("batch_small"));
  assert.equal(decoder.chunk(0).flags, FLAG.HELD | FLAG.GAP);
  const second = frames(decoder, 0, { encoding: 3, bones: 1 }).subarray(7);
  assert.deepEqual([...second.subarray(0, 3)], [1, 1.5, 1.25]);
  second.subarray(3).forEach((component) => assert.ok(Math.abs(component - 0.5) < 1e-4));
});

test("an event says what happened to whom", () => {
  assert.deepEqual(decoded(bytes("event")).event, {
    kind: "goal_reached", agentId: "a-7", alias: 300, at: 1_780_000_000.123456, goalRevision: 3, waypoint: 2,
    detail: "goal 3 of 4 reached",
  });
});

test("a decoder keeps nothing of the message before, but the token to resume", () => {
  const decoder = decoded(bytes("batch"));
  assert.equal(decoder.decode(bytes("heartbeat")), "heartbeat");
  assert.deepEqual([decoder.sentAt, decoder.chunks, decoder.added.length, decoder.removed], [1_780_000_000.2, 0, 0, 0]);
  assert.equal(decoder.resumeToken, "r.1.41");
});

test("chunks whose columns differ in length are refused", () => {
  const batch = [0x1a, 6, 0x12, 4, 0x0a, 2, 1, 2]; // two aliases, and nothing else
  assert.throws(() => decoded(new Uint8Array(batch)), /malformed message: columns/);
});

test("poses that are not whole frames are refused", () => {
  const player = new MotionPlayer();
  player.receive(bytes("header"), 0);
  assert.throws(() => player.receive(bytes("batch_small"), 0), /36 bytes of poses are not 2 frames of 44 bytes/);
});

test("every cut of a message is an error or a shorter message, never a hang", () => {
  const whole = bytes("batch");
  for (let length = 0; length < whole.length; length += 1) {
    try {
      decoded(whole.subarray(0, length));
    } catch (error) {
      assert.match(error.message, /malformed message/);
    }
  }
  assert.throws(() => decoded(whole.subarray(0, whole.length - 1)), /malformed/);
});

test("bytes of a longer message before it are not read", () => {
  const decoder = decoded(bytes("batch"));
  assert.throws(() => decoder.decode(bytes("batch").subarray(0, 40)), /malformed/);
});

test("unknown fields of every wire type are passed over", () => {
  // fields 20 to 23: varint -1, fixed64, block, fixed32; then field 1 = 5
  const unknown = [
    0xa0, 0x01, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01,
    0xa9, 0x01, 1, 2, 3, 4, 5, 6, 7, 8, 0xb2, 0x01, 2, 7, 7, 0xbd, 0x01, 1, 2, 3, 4, 0x08, 5,
  ];
  const { kind, sentAt } = decoded(new Uint8Array(unknown));
  assert.deepEqual([kind, sentAt], ["", 5e-6]);
});

test("numbers that JavaScript cannot hold, groups and field 0 are refused", () => {
  const read = (...values) => {
    const reader = new ProtoReader();
    reader.load(new Uint8Array(values));
    return reader.varint();
  };
  assert.throws(() => read(0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f), /2\^53/);
  assert.throws(() => read(...Array(11).fill(0xff)), /10 bytes/);
  assert.throws(() => decoded(new Uint8Array([0x0b])), /wire type 3 in place of 0/);
  assert.throws(() => decoded(new Uint8Array([0x00, 1])), /field number 0/);
});

test("a player shows agents, tells of them, and counts", () => {
  const heard = [];
  const note = (name) => (...given) => heard.push([name, ...given]);
  const player = new MotionPlayer({
    header: (header, again) => heard.push(["header", again]), added: ({ agent }) => heard.push(["added", agent.id]),
    removed: ({ agent }) => heard.push(["removed", agent.id]), event: note("event"),
    chunk: ({ agent }, { seq }) => heard.push(["chunk", agent.id, seq]),
  });
  assert.throws(() => player.receive(bytes("batch"), 0), /motion came before the header/);
  player.receive(bytes("header"), 0);
  assert.equal(player.receive(bytes("batch"), 0), "batch");
  assert.deepEqual(heard, [["header", false], ["added", "a-7"], ["chunk", "a-7", 12], ["removed", "a-7"]]);
  assert.deepEqual(player.stats, { messages: 3, bytes: player.stats.bytes, chunks: 2, frames: 6, gaps: 0, reduced: 0, held: 0 });
  assert.equal(player.resumeToken, "r.1.41");
  player.begin();
  assert.throws(() => player.receive(bytes("batch"), 0), /motion came before the header/);
  player.receive(bytes("header_small"), 0.1);
  player.receive(bytes("batch_small"), 0.1);
  const [zoe] = player.agents.values();
  player.advance(0.2);
  assert.ok(zoe.shown && zoe.state === "standing" && zoe.frame.length === 7);
  player.receive(bytes("event"), 0.2);
  assert.equal(heard.at(-1)[1].kind, "goal_reached");
  assert.deepEqual([player.stats.gaps, player.stats.held], [1, 1]);
});
