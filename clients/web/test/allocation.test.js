import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

const SCRIPT = fileURLToPath(new URL("allocation.js", import.meta.url));
const FLAGS = ["--expose-gc", "--no-concurrent-recompilation", "--max-semi-space-size=256"];

function bytesPerChunk(pictures) {
  const said = JSON.parse(execFileSync(process.execPath, [...FLAGS, SCRIPT, String(pictures)], { encoding: "utf-8" }));
  assert.equal(said.chunks, 10_000);
  return said.bytesPerChunk;
}

// A message of 25 chunks needs 230 bytes; the engine boxes a number (16 bytes) where it does not inline a call. The smallest
// object has 28 bytes, a Float32Array of a frame 500.

test("after warm-up, 10,000 chunks are decoded and kept without garbage", () => {
  const bytes = bytesPerChunk(0); // of 8 frames each
  assert.ok(bytes < 16, `${bytes} bytes of heap per chunk`);
});

test("after warm-up, poses are sampled and put on characters without garbage", () => {
  const bytes = bytesPerChunk(12) / 12;
  assert.ok(bytes < 8, `${bytes} bytes of heap per agent and picture`); // one boxed number has 16
});
