// Write src/gen from the repository's proto/: `npm run generate`, after `npm ci`.
//
// Needs protoc: the one that PROTOC names, that of the PATH, or that of the repository's Python
// environment (`make serve` makes it). The plugin comes from npm.

import { spawnSync } from "node:child_process";
import { existsSync, mkdirSync, readdirSync, rmSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const proto = join(here, "../../proto");
const python = join(here, "../../.venv/bin/python");
const out = join(here, "src/gen");

const files = readdirSync(join(proto, "wayfarer/v1")).filter((name) => name.endsWith(".proto"));
const options = [
  `--proto_path=${proto}`,
  `--plugin=protoc-gen-es=${join(here, "node_modules/.bin/protoc-gen-es")}`,
  `--es_out=${out}`,
  "--es_opt=target=js+dts,import_extension=js",
  ...files.map((name) => `wayfarer/v1/${name}`),
];
const compilers = [
  process.env.PROTOC && [process.env.PROTOC],
  ["protoc"],
  existsSync(python) && [python, "-m", "grpc_tools.protoc"],
].filter(Boolean);

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
for (const [command, ...first] of compilers) {
  const { error, status } = spawnSync(command, [...first, ...options], { stdio: "inherit" });
  if (error?.code === "ENOENT") continue;
  if (error) throw error;
  process.exit(status);
}
console.error("protoc is missing: install it (apt-get install protobuf-compiler), or name it in PROTOC");
process.exit(1);
