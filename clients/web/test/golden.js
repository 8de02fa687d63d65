// The files of tests/golden.

import { readFileSync } from "node:fs";

const folder = new URL("../../../tests/golden/", import.meta.url);

export const goldenBytes = (name) => new Uint8Array(readFileSync(new URL(name, folder)));

export const golden = (name) => JSON.parse(readFileSync(new URL(name, folder), "utf-8"));
