// What page and worker do alike to open a local session: the runtime, and the files of an export.

import { openExport } from "./graphs.js";
import { LocalHost } from "./host.js";
import { LocalScene } from "./scene.js";

/** @typedef {{ model: string, runtime: string, scene?: string }} Addresses absolute ones: the export's folder; ort.wasm.min.mjs; the scene's folder */

/**
 * @param {Addresses} addresses @param {(message: import("./host.js").HostMessage) => void} tell
 * @param {(bytes: number) => void} loaded told of what has come
 */
export async function openHost({ model, runtime, scene }, tell, loaded) {
  const read = async (/** @type {string | URL} */ address) => {
    const response = await fetch(address);
    if (!response.ok) throw new Error(`${response.url}: HTTP ${response.status}`);
    const bytes = await response.arrayBuffer();
    loaded(bytes.byteLength);
    return bytes;
  };
  const [opened, walked] = await Promise.all([
    openExport((name) => read(new URL(name, model)), openRuntime(runtime)),
    scene ? LocalScene.read((name) => read(new URL(name, scene))) : null,
  ]);
  return new LocalHost({ ...opened, scene: walked }, tell);
}

/** @param {string} runtime */
async function openRuntime(runtime) {
  const ort = await import(/* @vite-ignore */ /* webpackIgnore: true */ runtime);
  ort.env.wasm.numThreads = 1; // several need isolation by headers, which a plain web host does not send
  const folder = new URL(".", runtime).href;
  ort.env.wasm.wasmPaths = folder;
  return ort;
}
