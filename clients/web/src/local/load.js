// What page and worker do alike to open a local session: the runtime, and the files of an export.

import { openExport } from "./graphs.js";
import { LocalHost } from "./host.js";

/** @typedef {{ model: string, runtime: string }} Addresses absolute ones: the export's folder; ort.wasm.min.mjs */

/**
 * @param {Addresses} addresses @param {(message: import("./host.js").HostMessage) => void} tell
 * @param {(bytes: number) => void} loaded told of what has come
 */
export async function openHost({ model, runtime }, tell, loaded) {
  const ort = await import(/* @vite-ignore */ /* webpackIgnore: true */ runtime);
  ort.env.wasm.numThreads = 1; // several need isolation by headers, which a plain web host does not send
  ort.env.wasm.wasmPaths = new URL(".", runtime).href;
  const read = async (/** @type {string} */ name) => {
    const response = await fetch(new URL(name, model));
    if (!response.ok) throw new Error(`${response.url}: HTTP ${response.status}`);
    const bytes = await response.arrayBuffer();
    loaded(bytes.byteLength);
    return bytes;
  };
  return new LocalHost(await openExport(read, ort), tell);
}
