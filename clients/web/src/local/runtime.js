// onnxruntime-web on WASM, one thread: opened in each worker that runs a graph.

/** The part of onnxruntime-web that is used. @typedef {any} Runtime */
/** Runs a graph: inputs by name to outputs by name. @typedef {(feeds: Record<string, import("./world.js").Tensor>) => Promise<Record<string, Float32Array>>} RunGraph */

const FLOATS = "weights.f32"; // name of the weights that graphs share

/**
 * @param {string} address absolute, of ort.wasm.min.mjs @param {ArrayBuffer | Promise<ArrayBuffer>} wasm its WebAssembly
 * @returns {Promise<Runtime>}
 */
export async function openRuntime(address, wasm) {
  const ort = await import(/* @vite-ignore */ /* webpackIgnore: true */ address);
  ort.env.wasm.wasmBinary = await wasm;
  ort.env.wasm.numThreads = 1; // more need cross-origin isolation headers, which a plain web host does not send
  ort.env.wasm.wasmPaths = new URL(".", address).href;
  return ort;
}

/** @param {Runtime} ort @param {ArrayBuffer} model @param {Float32Array | null} weights @returns {Promise<RunGraph>} */
export async function openGraph(ort, model, weights) {
  const externalData = weights ? [{ path: FLOATS, data: new Uint8Array(weights.buffer) }] : [];
  // these graphs are already optimised, and checking takes a third of the time
  const options = { executionProviders: ["wasm"], graphOptimizationLevel: "disabled", externalData };
  const session = await ort.InferenceSession.create(new Uint8Array(model), options);
  return async (feeds) => {
    const given = Object.entries(feeds).map(([name, { data, dims }]) => [name, new ort.Tensor("float32", data, dims)]);
    const found = await session.run(Object.fromEntries(given));
    return Object.fromEntries(Object.entries(found).map(([name, tensor]) => [name, /** @type {any} */ (tensor).data]));
  };
}
