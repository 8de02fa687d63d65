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

// A boxed number has 16 bytes. One that this script passes to the player, the time, may be boxed: once a message of 25
// chunks, or twice.

test("after warm-up, 10,000 chunks are decoded and kept without garbage", () => {
  const bytes = 25 * bytesPerChunk(0);
  assert.ok(bytes < 16, `${bytes} bytes of heap per message`);
});

test("after warm-up, poses are sampled and put on characters without garbage", () => {
  const bytes = 25 * bytesPerChunk(12); // pictures of 25 agents
  assert.ok(bytes <= 32, `${bytes} bytes of heap per message and its 12 pictures`);
});
