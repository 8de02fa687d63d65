// Shared by page and worker to open a local session: the runtime, and the files of an export.

import { openExport } from "./graphs.js";
import { LocalHost } from "./host.js";
import { openRuntime } from "./runtime.js";
import { LocalScene } from "./scene.js";
import { unpacked } from "./unpacked.js";

const WASM = "ort-wasm-simd-threaded.wasm"; // beside ort.wasm.min.mjs

/** @typedef {{ model: string, runtime: string, scene?: string, avoid?: boolean }} Addresses absolute ones: the export's folder; ort.wasm.min.mjs; the scene's folder */

/**
 * @param {Addresses} addresses @param {(message: import("./host.js").HostMessage) => void} tell
 * @param {(bytes: number) => void} loaded receives the number of bytes that have come
 */
export async function openHost({ model, runtime, scene, avoid }, tell, loaded) {
  const read = async (/** @type {string | URL} */ address) => {
    const response = await fetch(address);
    if (!response.ok) throw new Error(`${response.url}: HTTP ${response.status}`);
    const bytes = await response.arrayBuffer();
    loaded(bytes.byteLength);
    return bytes;
  };
  const wasm = read(new URL(WASM, runtime)).then(unpacked);
  const [opened, walked] = await Promise.all([
    openExport((name) => read(new URL(name, model)), openRuntime(runtime, wasm), inWorker(runtime, wasm)),
    scene ? LocalScene.read((name) => read(new URL(name, scene))) : null,
  ]);
  return new LocalHost({ ...opened, scene: walked, avoid }, tell);
}

/**
 * Opens a graph in its own worker, which ends with this one. Rejects if workers cannot start workers.
 * @param {string} runtime @param {Promise<ArrayBuffer>} wasm @returns {import("./graphs.js").Elsewhere}
 */
const inWorker = (runtime, wasm) => async (model, weights) => {
  const worker = new Worker(new URL("./graph_worker.js", import.meta.url), { type: "module" });
  /** @type {Map<number, { done: (value: any) => void, failed: (error: Error) => void }>} */
  const calls = new Map();
  let last = 0;
  const ask = (/** @type {any} */ message) => new Promise((done, failed) => {
    calls.set(last += 1, { done, failed });
    worker.postMessage({ id: last, ...message });
  });
  worker.addEventListener("message", ({ data: { id, outputs, error } }) => {
    const call = calls.get(id);
    calls.delete(id);
    if (error) call?.failed(new Error(error));
    else call?.done(outputs);
  });
  worker.addEventListener("error", (event) => {
    for (const { failed } of calls.values()) failed(new Error(event.message || "a worker could not be loaded"));
    calls.clear();
  });
  await ask({ open: [runtime, await wasm, model, weights] });
  return (feeds) => ask({ feeds });
};
