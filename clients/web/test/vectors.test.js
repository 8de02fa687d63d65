// The vectors that every client decodes: tests/golden/README.md.

import assert from "node:assert/strict";
import { test } from "node:test";
import { ENCODING, frameBytes, unpackPoses } from "../src/core/index.js";
import { golden, goldenBytes } from "./golden.js";

const { bases, vectors, tolerance_deg: tolerances } = golden("vectors.json");
const IDENTITY = [0, 0, 0, 1];

for (const vector of vectors) {
  test(vector.name, () => {
    const encoding = ENCODING[vector.encoding.toUpperCase()];
    const bones = vector.bones.length;
    const bytes = goldenBytes(vector.poses);
    assert.equal(frameBytes(encoding, bones), vector.frame_bytes);
    assert.equal(bytes.length, vector.frame_bytes * vector.frames.length);
    const out = new Float32Array((3 + 4 * bones) * vector.frames.length);
    unpackPoses(new DataView(bytes.buffer, bytes.byteOffset), 0, vector.frames.length, encoding, bones, out);
    const { translation, rotations } = bases[vector.basis];
    vector.frames.forEach((number, k) => {
      const frame = out.subarray((3 + 4 * bones) * k);
      assert.deepEqual([...frame.subarray(0, 3)], translation[number]);
      vector.bones.forEach((bone, b) => {
        const wanted = rotations[number][bone] ?? IDENTITY;
        const found = frame.subarray(3 + 4 * b, 7 + 4 * b);
        assert.ok(degreesBetween(found, wanted) <= tolerances[vector.encoding], `bone ${bone} of frame ${number}`);
      });
    });
  });
}

test("an encoding of a later server is refused", () => {
  assert.throws(() => frameBytes(9, 22), /encoding 9 is not known: this client is older/);
});

/** Between two rotations; q and -q are the same one. */
function degreesBetween(a, b) {
  const distance = (sign) => Math.hypot(...[...a].map((value, k) => value - sign * b[k]));
  return (4 * Math.asin(Math.min(distance(1), distance(-1)) / 2) * 180) / Math.PI;
}
