// The vectors that every client decodes: tests/golden/README.md.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { ENCODING, unpackPoses } from "../../service/wayfarer/transport/viewer/poses.js";

const folder = new URL("../golden/", import.meta.url);
const { bases, vectors, tolerance_deg: tolerances } = JSON.parse(readFileSync(new URL("vectors.json", folder)));
const IDENTITY = [0, 0, 0, 1];

for (const vector of vectors) {
  test(vector.name, () => {
    const layout = { encoding: ENCODING[vector.encoding.toUpperCase()], bones: vector.bones.length };
    const frames = unpackPoses(new Uint8Array(readFileSync(new URL(vector.poses, folder))), layout);
    assert.equal(frames.length, vector.frames.length);
    const { translation, rotations } = bases[vector.basis];
    frames.forEach((frame, k) => {
      const number = vector.frames[k];
      assert.deepEqual([...frame.subarray(0, 3)], translation[number]);
      vector.bones.forEach((bone, b) => {
        const found = frame.subarray(3 + 4 * b, 7 + 4 * b);
        const wanted = rotations[number][bone] ?? IDENTITY;
        assert.ok(degreesBetween(found, wanted) <= tolerances[vector.encoding], `bone ${bone} of frame ${number}`);
      });
    });
  });
}

/** Between two rotations; q and -q are the same one. */
function degreesBetween(a, b) {
  const distance = (sign) => Math.hypot(...[...a].map((value, k) => value - sign * b[k]));
  return (4 * Math.asin(Math.min(distance(1), distance(-1)) / 2) * 180) / Math.PI;
}
