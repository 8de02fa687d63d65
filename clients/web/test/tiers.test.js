// Levels of detail: tiers with less than all bones become poses with all.

import assert from "node:assert/strict";
import { test } from "node:test";
import { MotionPlayer, StreamDecoder } from "../src/core/index.js";
import { TierUnpacker } from "../src/core/tiers.js";
import { golden } from "./golden.js";

const MESSAGES = golden("messages.json");
const message = (name) => Uint8Array.from(Buffer.from(MESSAGES[name], "hex"));

for (const { basis, bones, tiers } of golden("tiers.json").cases) {
  test(`tiers in ${basis}`, () => {
    const known = tiers.map(({ encoding, sent_fps: sentFps, bones: sent }) => ({ encoding, sentFps, bones: sent }));
    const unpacker = new TierUnpacker({ basis, bones, tiers: [{ encoding: 1, sentFps: 40, bones }, ...known] });
    tiers.forEach(({ poses, frame_bytes: each, hips, rotations }, k) => {
      const bytes = Uint8Array.from(Buffer.from(poses, "hex"));
      const count = bytes.length / each;
      const out = new Float32Array(91 * count);
      unpacker.unpack(new DataView(bytes.buffer), 0, count, k + 1, out);
      for (let frame = 0; frame < count; frame += 1) {
        for (let n = 0; n < 3; n += 1) assert.ok(Math.abs(out[91 * frame + n] - hips[3 * frame + n]) < 1e-3);
        for (let bone = 0; bone < 22; bone += 1) {
          const found = out.subarray(91 * frame + 3 + 4 * bone, 91 * frame + 7 + 4 * bone);
          const wanted = rotations.slice(88 * frame + 4 * bone, 88 * frame + 4 * bone + 4);
          const apart = (sign) => Math.max(...wanted.map((value, n) => Math.abs(value - sign * found[n])));
          assert.ok(Math.min(apart(1), apart(-1)) < 1e-3, `frame ${frame}, bone ${bone}`);
        }
      }
    });
  });
}

test("a header with tiers, a batch of roots, and who is hidden", () => {
  const decoder = new StreamDecoder();
  decoder.decode(message("header_tiers"));
  assert.deepEqual(decoder.header.tiers.map(({ radius, encoding, sentFps, bones, frameBytes }) => (
    [radius, encoding, sentFps, bones, frameBytes]
  )), [[10, 1, 40, [0, 1], 44], [30.5, 3, 20, [1], 18], [300, 4, 10, [], 16]]);
  decoder.decode(message("batch_root"));
  assert.deepEqual([decoder.tier, decoder.hidden, decoder.hiddenAlias(0), decoder.hiddenAlias(1)], [2, 2, 7, 1000]);
  decoder.decode(message("batch"));
  assert.deepEqual([decoder.tier, decoder.hidden], [0, 0]);
});

test("a player shows all tiers alike, and takes away who is hidden", () => {
  const told = [];
  const player = new MotionPlayer({
    added: ({ agent }) => told.push(`+${agent.alias}`),
    removed: ({ agent, hidden }) => told.push(`${hidden ? "hidden " : "-"}${agent.alias}`),
  });
  player.receive(message("header_tiers"), 0);
  player.receive(message("batch_root"), 0);
  player.advance(0.1);
  const [played] = player.agents.values();
  assert.ok(played.shown && played.tier === 2 && played.frame.length === 11);
  assert.deepEqual([...played.frame.subarray(0, 3)], [0, 0.5, 0.25]);
  // turned by 90 degrees about up
  assert.ok(Math.abs(Math.abs(played.frame[4]) - Math.SQRT1_2) < 0.1);
  const hiding = Uint8Array.from([0x1a, 4, 0x32, 2, 0xac, 2]); // batch { hidden: [300] }
  assert.equal(player.receive(hiding, 1), "batch");
  assert.deepEqual(told, ["+300", "hidden 300"]);
  player.receive(message("batch_root"), 1);
  assert.deepEqual(told.slice(2), ["+300"]);
});

test("who comes nearer goes on, and who was not introduced is not shown", () => {
  const told = [];
  const player = new MotionPlayer({
    added: ({ agent }) => told.push(`+${agent.alias}`),
    removed: ({ agent }) => told.push(`-${agent.alias}`),
  });
  player.receive(message("header_tiers"), 0);
  player.receive(message("batch_closer"), 0);
  assert.equal(player.agents.size, 0);
  player.receive(message("batch_root"), 0);
  const [played] = player.agents.values();
  assert.equal(played.tier, 2);
  player.receive(message("batch_closer"), 0.2);
  player.advance(0.3);
  assert.ok(played.shown && played.tier === 1 && player.agents.get(300) === played);
  const hiding = Uint8Array.from([0x1a, 4, 0x32, 2, 0xac, 2]); // batch { hidden: [300] }
  player.receive(hiding, 0.4);
  player.receive(message("batch_closer"), 0.4);
  assert.equal(player.agents.size, 0);
  assert.deepEqual(told, ["+300", "-300"]);
});

test("a batch of a tier that the header does not know is refused", () => {
  const player = new MotionPlayer();
  player.receive(message("header"), 0);
  assert.throws(() => player.receive(message("batch_root"), 0), /1 tiers, not of 2/);
});

test("a stream of roots alone has the bones of a body", () => {
  const decoder = new StreamDecoder();
  // header { pose_encoding: ROOT, sent_fps: 10, frame_bytes: 16 }
  decoder.decode(Uint8Array.from([0x12, 6, 0x30, 4, 0x38, 10, 0x48, 16]));
  assert.equal(decoder.header.bones.length, 22);
  assert.deepEqual(decoder.header.tiers[0].bones, []);
});
