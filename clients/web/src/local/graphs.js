// The graphs of an export, opened in onnxruntime-web on WASM: no network beyond the export's own files.

import { openGraph } from "./runtime.js";
import { unpacked } from "./unpacked.js";

const WEIGHTS = "halves.bin";

/** Reads a file of the export, packed or not. @typedef {(name: string) => Promise<ArrayBuffer>} Read */
/** Opens a graph in another thread. @typedef {(model: ArrayBuffer, weights: Float32Array | null) => Promise<import("./runtime.js").RunGraph>} Elsewhere */

/**
 * Reads a folder written by `wayfarer export --for web`, and opens its graphs. All files are requested at once.
 * @param {Read} reader @param {import("./runtime.js").Runtime | Promise<import("./runtime.js").Runtime>} runtime onnxruntime-web
 * @param {Elsewhere | null} [elsewhere] opens all graphs but the first, all at the same time. Without it, or if it
 * fails, they are opened in this thread, one after the other
 * @returns {Promise<{ about: any, bodies: Record<string, ArrayBuffer>, run: import("./world.js").Run }>}
 */
export async function openExport(reader, runtime, elsewhere = null) {
  const read = async (/** @type {string} */ name) => unpacked(await reader(name));
  const about = JSON.parse(new TextDecoder().decode(await read("wayfarer.json")));
  const genders = Object.keys(about.bodies ?? {});
  if (!genders.length) throw new Error("wayfarer.json: no bodies: make the folder with wayfarer export --for web");
  const shares = WEIGHTS in about.files;
  const [ort, halves, parts, graphs] = await Promise.all([
    runtime, shares ? read(WEIGHTS) : null,
    Promise.all(genders.map((gender) => read(about.bodies[gender].file))),
    Promise.all(genders.map((gender) => read(`step_${gender}.onnx`))),
  ]);
  const bodies = Object.fromEntries(genders.map((gender, k) => [gender, parts[k]]));
  const weights = halves && widened(halves);
  const others = graphs.map((graph, k) => (k && elsewhere ? elsewhere(graph, weights).catch(() => null) : null));
  /** @type {Record<string, import("./runtime.js").RunGraph>} */
  const runs = {};
  for (const [k, gender] of genders.entries()) runs[gender] = (await others[k]) ?? await openGraph(ort, graphs[k], weights);
  return { about, bodies, run: (gender, feeds) => runs[gender](feeds) };
}

/** float32 of float16, of which all low bytes come first: see weights.py of the exporter. @param {ArrayBuffer} bytes */
function widened(bytes) {
  const table = Float32Array.from({ length: 65536 }, (_, bits) => {
    const power = (bits >> 10) & 31, part = bits & 1023;
    const size = power ? 2 ** (power - 15) * (1 + part / 1024) : 2 ** -24 * part;
    return bits & 32768 ? -size : size;
  });
  const count = bytes.byteLength / 2, floats = new Float32Array(count);
  const low = new Uint8Array(bytes, 0, count), high = new Uint8Array(bytes, count);
  for (let k = 0; k < count; k += 1) floats[k] = table[(high[k] << 8) | low[k]];
  return floats;
}
