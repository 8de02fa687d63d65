// Write src/gen from the repository's proto/: `npm run generate`, after `npm ci`.
//
// Needs protoc 3.21 or newer: the one that PROTOC names, that of the PATH, or that of the
// repository's Python environment (`make serve` makes it); when one fails, the next is tried. The
// plugin comes from npm. src/gen is there after a success only.

import { spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readdirSync, renameSync, rmSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const proto = join(here, "../../proto");
const python = join(here, "../../.venv/bin/python");
const target = join(here, "src/gen");

const MISSING = "is not there";

const compilers = [
  process.env.PROTOC && [process.env.PROTOC],
  ["protoc"],
  existsSync(python) && [python, "-m", "grpc_tools.protoc"],
].filter(Boolean);

/** Why this compiler could not write the code into `out`; undefined when it has. */
function failure([command, ...first], out) {
  const files = readdirSync(join(proto, "wayfarer/v1")).filter((name) => name.endsWith(".proto"));
  const options = [
    `--proto_path=${proto}`,
    `--plugin=protoc-gen-es=${join(here, "node_modules/.bin/protoc-gen-es")}`,
    `--es_out=${out}`,
    "--es_opt=target=js+dts,import_extension=js",
    ...files.map((name) => `wayfarer/v1/${name}`),
  ];
  const { error, status, signal, stderr } = spawnSync(command, [...first, ...options], {
    encoding: "utf8",
  });
  if (error) return error.code === "ENOENT" ? MISSING : error.message;
  if (status === 0) return undefined;
  return `${signal ? `was ended by ${signal}` : `failed with ${status}`}\n${stderr.trimEnd()}`;
}

/** Writes the code with the first compiler that can; what kept the others from it. */
function generate() {
  const refusals = [];
  for (const compiler of compilers) {
    const out = mkdtempSync(join(here, "src", ".gen-"));
    try {
      const why = failure(compiler, out);
      if (why === undefined) {
        rmSync(target, { recursive: true, force: true });
        renameSync(out, target);
        return { done: true, refusals };
      }
      refusals.push(`${compiler.join(" ")} ${why}`);
    } finally {
      rmSync(out, { recursive: true, force: true });
    }
  }
  return { done: false, refusals };
}

const { done, refusals } = generate();
for (const refusal of refusals) {
  if (!done || !refusal.endsWith(MISSING)) console.error(refusal);
}
if (!done) {
  console.error(
    "No protoc wrote the code. Install one (apt-get install protobuf-compiler), name it in PROTOC, " +
      "or make the repository's Python environment (make serve).",
  );
  process.exit(1);
}
