// How generate.js chooses its compiler, and what a failure leaves behind. Compilers are scripts.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { chmodSync, copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { delimiter, dirname, join } from "node:path";
import { afterEach, beforeEach, test } from "node:test";

const WORKS = 'for a in "$@"; do case $a in --es_out=*) echo "by $0" > "${a#--es_out=}/made_pb.js";; esac; done';
const FAILS = 'for a in "$@"; do case $a in --es_out=*) echo half > "${a#--es_out=}/made_pb.js";; esac; done; echo "clips collides" >&2; exit 1';

let root, node;

beforeEach(() => {
  root = mkdtempSync(join(tmpdir(), "generate-"));
  node = join(root, "clients/node");
  mkdirSync(join(node, "src"), { recursive: true });
  mkdirSync(join(root, "proto/wayfarer/v1"), { recursive: true });
  writeFileSync(join(root, "proto/wayfarer/v1/goal.proto"), 'syntax = "proto3";');
  copyFileSync(new URL("../generate.js", import.meta.url), join(node, "generate.js"));
  writeFileSync(join(node, "package.json"), '{"type": "module"}');
});
afterEach(() => rmSync(root, { recursive: true }));

function script(path, body) {
  mkdirSync(dirname(join(root, path)), { recursive: true });
  writeFileSync(join(root, path), `#!/bin/sh\n${body}\n`);
  chmodSync(join(root, path), 0o755);
  return join(root, path);
}

function generate(environment = {}) {
  const path = [join(root, "bin"), "/usr/bin", "/bin"].join(delimiter);
  return spawnSync(process.execPath, [join(node, "generate.js")], {
    encoding: "utf8",
    env: { PATH: path, ...environment },
  });
}

const made = () => readFileSync(join(node, "src/gen/made_pb.js"), "utf8");

test("the compiler that PROTOC names comes first", () => {
  script("bin/protoc", FAILS);
  const mine = script("mine", WORKS);
  assert.equal(generate({ PROTOC: mine }).status, 0);
  assert.match(made(), /by .*mine/);
});

test("one that fails is followed by the next, and nothing of it is left", () => {
  script("bin/protoc", FAILS);
  script(".venv/bin/python", WORKS);
  const done = generate({ PROTOC: join(root, "no-such-file") });
  assert.equal(done.status, 0);
  assert.match(made(), /by .*python/);
  assert.deepEqual(readdirSync(join(node, "src")), ["gen"]);
});

test("when all fail it says why of each, and leaves what was there", () => {
  script("bin/protoc", FAILS);
  const first = generate();
  assert.equal(first.status, 1);
  assert.match(first.stderr, /clips collides[^]*apt-get install protobuf-compiler/);
  assert.deepEqual(readdirSync(join(node, "src")), []);
  script("bin/protoc", WORKS);
  assert.equal(generate().status, 0);
  const before = made();
  script("bin/protoc", FAILS);
  assert.equal(generate({ PROTOC: script("mine", FAILS) }).status, 1);
  assert.equal(made(), before);
  assert.ok(existsSync(join(node, "src/gen")));
});
