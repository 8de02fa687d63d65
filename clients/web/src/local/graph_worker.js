// Runs one graph for the worker of a local session, so that two graphs open at the same time:
// { id, open: [runtime, wasm, model, weights] } or { id, feeds } come in, { id, outputs } or { id, error } go out.

import { openGraph, openRuntime } from "./runtime.js";

/** @type {import("./runtime.js").RunGraph | null} */
let run = null;

/** @param {any} message @param {Transferable[]} [moved] */
const post = (message, moved = []) => /** @type {any} */ (globalThis).postMessage(message, moved);

globalThis.addEventListener("message", async ({ data: { id, open, feeds } }) => {
  try {
    if (open) {
      const [runtime, wasm, model, weights] = open;
      run = await openGraph(await openRuntime(runtime, wasm), model, weights);
      post({ id });
    } else if (run) {
      const outputs = await run(feeds);
      post({ id, outputs }, Object.values(outputs).map(({ buffer }) => /** @type {ArrayBuffer} */ (buffer)));
    }
  } catch (error) {
    post({ id, error: String(/** @type {Error} */ (error).message) });
  }
});
