import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { FLAG, decodeStreamMessage } from "../../service/wayfarer/transport/viewer/messages.js";
import { unpackPoses } from "../../service/wayfarer/transport/viewer/poses.js";
import { ProtoReader } from "../../service/wayfarer/transport/viewer/protobuf.js";

const golden = JSON.parse(readFileSync(new URL("../golden/messages.json", import.meta.url)));
const FLOATS = { encoding: 1, bones: 2 };
const bytes = (name) => new Uint8Array(Buffer.from(golden[name], "hex"));

test("a header gives rate, skeleton and encoding", () => {
  const { sentAt, header } = decodeStreamMessage(bytes("header"));
  assert.equal(sentAt, 1_780_000_000.2);
  assert.deepEqual(header, {
    serverVersion: "1.2.3", sessionId: "s-1", fps: 40, sentFps: 40, encoding: 1, frameBytes: 44,
    skeleton: [{ name: "pelvis", parent: -1 }, { name: "left_hip", parent: 0 }],
    bones: [0, 1], resumed: false,
  });
  const small = decodeStreamMessage(bytes("header_small")).header;
  assert.deepEqual([small.encoding, small.sentFps, small.bones, small.frameBytes, small.resumed], [3, 10, [1], 18, true]);
});

test("a batch gives new agents, chunks and removals", () => {
  const { batch } = decodeStreamMessage(bytes("batch"));
  assert.deepEqual(batch.added, [{
    id: "a-7", alias: 300, name: "Zoë", body: "anny52", gender: "male",
    betas: [0.5, -1.25, 3], seed: 4294967295,
  }]);
  assert.deepEqual(batch.removed, [1, 300]);
  assert.equal(batch.resumeToken, "r.1.41");
  const [{ poses, contacts, ...chunk }, second] = batch.chunks;
  assert.deepEqual(chunk, {
    alias: 300, seq: 12, firstFrame: 96, scheduledAt: 1_780_000_000.123456, goalRevision: 3,
    state: "walking", flags: FLAG.FIRST | FLAG.ARRIVED, waypoint: 2, candidates: 8,
  });
  assert.deepEqual([...contacts], [1, 3, 2]);
  const frames = unpackPoses(poses, FLOATS);
  assert.equal(frames.length, 3);
  assert.deepEqual([...frames[2]], [2, 2.5, 2.25, 0, 0, 0, 1, 0.5, -0.5, 0.5, -0.5]);
  assert.deepEqual([second.alias, second.seq, second.state, second.scheduledAt], [7, 0, "standing", 1_780_000_000.148456]);
  assert.deepEqual([...second.contacts], [3, 3, 0]);
  assert.equal(unpackPoses(second.poses, FLOATS)[0][0], 3);
});

test("chunks whose columns differ in length are refused", () => {
  const batch = [0x1a, 6, 0x12, 4, 0x0a, 2, 1, 2]; // two aliases, and nothing else
  assert.throws(() => decodeStreamMessage(new Uint8Array(batch)), /malformed message: columns/);
});

test("smallest-three poses and held motion", () => {
  const [chunk] = decodeStreamMessage(bytes("batch_small")).batch.chunks;
  assert.equal(chunk.flags, FLAG.HELD | FLAG.GAP);
  const [, second] = unpackPoses(chunk.poses, { encoding: 3, bones: 1 });
  assert.deepEqual([...second.subarray(0, 3)], [1, 1.5, 1.25]);
  second.subarray(3).forEach((component) => assert.ok(Math.abs(component - 0.5) < 1e-4));
});

test("an event says what happened to whom", () => {
  assert.deepEqual(decodeStreamMessage(bytes("event")).event, {
    kind: "goal_reached", agentId: "a-7", alias: 300, at: 1_780_000_000.123456, goalRevision: 3,
    waypoint: 2, detail: "goal 3 of 4 reached",
  });
});

test("a heartbeat has only its time", () => {
  assert.deepEqual(decodeStreamMessage(bytes("heartbeat")), { sentAt: 1_780_000_000.2, heartbeat: true });
});

test("a message in the middle of a larger buffer is read in place", () => {
  const padded = new Uint8Array([9, 9, 9, ...bytes("batch"), 9]);
  const { batch } = decodeStreamMessage(padded.subarray(3, padded.length - 1));
  assert.equal(unpackPoses(batch.chunks[0].poses, FLOATS)[1][1], 1.5);
});

test("every cut of a message is an error or a shorter message, never a hang", () => {
  const whole = bytes("batch");
  for (let length = 0; length < whole.length; length += 1) {
    try {
      decodeStreamMessage(whole.subarray(0, length));
    } catch (error) {
      assert.match(error.message, /malformed message/);
    }
  }
  assert.throws(() => decodeStreamMessage(whole.subarray(0, whole.length - 1)), /malformed/);
});

test("unknown fields of every wire type are passed over", () => {
  // fields 20 to 23: varint -1, fixed64, block, fixed32; then field 1 = 5
  const unknown = [
    0xa0, 0x01, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01,
    0xa9, 0x01, 1, 2, 3, 4, 5, 6, 7, 8, 0xb2, 0x01, 2, 7, 7, 0xbd, 0x01, 1, 2, 3, 4, 0x08, 5,
  ];
  assert.deepEqual(decodeStreamMessage(new Uint8Array(unknown)), { sentAt: 5e-6 });
});

test("numbers that JavaScript cannot hold, groups and field 0 are refused", () => {
  const reader = (...values) => new ProtoReader(new Uint8Array(values));
  assert.throws(() => reader(0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x7f).varint(), /2\^53/);
  assert.throws(() => reader(...Array(11).fill(0xff)).varint(), /10 bytes/);
  assert.throws(() => decodeStreamMessage(new Uint8Array([0x0b])), /wire type 3 in place of 0/);
  assert.throws(() => decodeStreamMessage(new Uint8Array([0x00, 1])), /field number 0/);
});

test("poses that are not whole frames are refused", () => {
  assert.throws(() => unpackPoses(new Uint8Array(45), FLOATS), /45 bytes are not whole frames of 44/);
  assert.throws(() => unpackPoses(new Uint8Array(0), { encoding: 9, bones: 2 }), /encoding 9 is not known/);
  assert.deepEqual(unpackPoses(new Uint8Array(0), FLOATS), []);
});
