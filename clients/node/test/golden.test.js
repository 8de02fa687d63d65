// The vectors that every client decodes (tests/golden/README.md), as batches of gRPC.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { PoseEncoding, unpackChunks } from "../src/index.js";

const folder = new URL("../../../tests/golden/", import.meta.url);
const { bases, vectors, tolerance_deg: tolerances } = JSON.parse(readFileSync(new URL("vectors.json", folder)));
const IDENTITY = [0, 0, 0, 1];
const ONE = { seqs: [1n], firstFrames: [8n], scheduledAtUs: [5n], goalRevisions: [1], states: [1], flags: [1], waypoints: [0], candidates: [1] };

for (const vector of vectors) {
  test(vector.name, () => {
    const header = { poseEncoding: PoseEncoding[vector.encoding.toUpperCase()], bones: vector.bones };
    const bytes = Buffer.from(vector.contacts, "hex");
    const poses = readFileSync(new URL(vector.poses, folder));
    const [{ frames, contacts }] = unpackChunks({ ...ONE, aliases: [7], poses, contacts: bytes }, header);
    assert.deepEqual([...contacts], [...bytes]);
    vector.frames.forEach((number, k) => {
      assert.deepEqual([...frames[k].subarray(0, 3)], bases[vector.basis].translation[number]);
      vector.bones.forEach((bone, b) => {
        const wanted = bases[vector.basis].rotations[number][bone] ?? IDENTITY;
        const off = degreesBetween(frames[k].subarray(3 + 4 * b, 7 + 4 * b), wanted);
        assert.ok(off <= tolerances[vector.encoding], `bone ${bone} of frame ${number}: ${off} degrees`);
      });
    });
  });
}

test("chunks of a batch come one by one", () => {
  const header = { poseEncoding: PoseEncoding.F32_LE, bones: [] };
  const poses = Buffer.alloc(4 * 12);
  poses.writeFloatLE(2.5, 3 * 12);
  const ones = [1, 1];
  const chunks = {
    aliases: [7, 9], seqs: [1n, 2n], firstFrames: [8n, 16n], scheduledAtUs: [5n, 6n], goalRevisions: ones,
    states: ones, flags: ones, waypoints: ones, candidates: ones, poses, contacts: Buffer.from([0, 1, 2, 3]),
  };
  const [first, second] = unpackChunks(chunks, header);
  assert.deepEqual([first.alias, first.frames.length, first.contacts[1]], [7, 2, 1]);
  assert.deepEqual([second.seq, second.firstFrame, second.scheduledAtUs], [2n, 16n, 6n]);
  assert.equal(second.frames[1][0], 2.5);
  assert.deepEqual(unpackChunks(undefined, header), []);
  assert.throws(() => unpackChunks({ ...chunks, seqs: [1n] }, header), /of 2 chunks are not of one length/);
  assert.throws(() => unpackChunks({ ...chunks, contacts: Buffer.alloc(3) }, header), /not of one length/);
  assert.throws(() => unpackChunks({ ...chunks, poses: Buffer.alloc(29) }, header), /29 bytes of poses are not 4 frames of 12/);
  assert.throws(() => unpackChunks(chunks, { poseEncoding: 9, bones: [] }), /encoding 9 is not known/);
});

/** Between two rotations; q and -q are the same one. */
function degreesBetween(a, b) {
  const distance = (sign) => Math.hypot(...[...a].map((value, k) => value - sign * b[k]));
  return (4 * Math.asin(Math.min(distance(1), distance(-1)) / 2) * 180) / Math.PI;
}

for (const { basis, bones, tiers } of JSON.parse(readFileSync(new URL("tiers.json", folder))).cases) {
  test(`tiers in ${basis}`, () => {
    const known = tiers.map(({ encoding, sent_fps: sentFps, bones: sent }) => ({ poseEncoding: encoding, sentFps, bones: sent }));
    const number = ["", "gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros"].indexOf(basis);
    const first = { poseEncoding: PoseEncoding.F32_LE, sentFps: 40, bones };
    const header = { ...first, basis: { basis: number }, tiers: [first, ...known] };
    tiers.forEach(({ poses, frame_bytes: each, hips, rotations }, k) => {
      const bytes = Buffer.from(poses, "hex");
      const contacts = Buffer.alloc(bytes.length / each);
      const [{ frames }] = unpackChunks({ ...ONE, aliases: [7], poses: bytes, contacts }, header, k + 1);
      frames.forEach((frame, at) => {
        for (let n = 0; n < 3; n += 1) assert.ok(Math.abs(frame[n] - hips[3 * at + n]) < 1e-3);
        for (let bone = 0; bone < 22; bone += 1) {
          const wanted = rotations.slice(88 * at + 4 * bone, 88 * at + 4 * bone + 4);
          assert.ok(degreesBetween(frame.subarray(3 + 4 * bone, 7 + 4 * bone), wanted) < 0.1, `bone ${bone}`);
        }
      });
    });
    const chunks = { ...ONE, aliases: [7], poses: Buffer.alloc(16), contacts: Buffer.alloc(1) };
    assert.throws(() => unpackChunks(chunks, header, 3), /3 tiers, not of 3/);
  });
}
