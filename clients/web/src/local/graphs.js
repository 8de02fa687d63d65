// The graphs of an export, opened in onnxruntime-web on WASM: one thread, no network beyond the export's own files.

/** Reads a file of the export. @typedef {(name: string) => Promise<ArrayBuffer>} Read */
/** As much of onnxruntime-web as is used. @typedef {any} Runtime */

/**
 * Read a folder that `wayfarer export --for web` has written, and open its graphs.
 * @param {Read} read @param {Runtime} ort onnxruntime-web
 * @returns {Promise<{ about: any, bodies: Record<string, ArrayBuffer>, run: import("./world.js").Run }>}
 */
export async function openExport(read, ort) {
  const about = JSON.parse(new TextDecoder().decode(await read("wayfarer.json")));
  const genders = Object.keys(about.bodies ?? {});
  if (!genders.length) throw new Error("wayfarer.json: no bodies: make the folder with wayfarer export --for web");
  const shared = "weights.bin" in about.files ? [{ path: "weights.bin", data: new Uint8Array(await read("weights.bin")) }] : [];
  const bodies = Object.fromEntries(await Promise.all(genders.map(
    async (gender) => [gender, await read(about.bodies[gender].file)])));
  /** @type {Map<string, any>} */
  const sessions = new Map();
  for (const gender of genders) {
    const graph = new Uint8Array(await read(`step_${gender}.onnx`));
    // higher levels take half as long again to open, and the step is no faster
    const options = { executionProviders: ["wasm"], graphOptimizationLevel: "basic", externalData: shared };
    sessions.set(gender, await ort.InferenceSession.create(graph, options));
  }
  return {
    about, bodies,
    run: async (gender, feeds) => {
      const given = Object.entries(feeds).map(([name, { data, dims }]) => [name, new ort.Tensor("float32", data, dims)]);
      const found = await sessions.get(gender).run(Object.fromEntries(given));
      return Object.fromEntries(Object.entries(found).map(([name, tensor]) => [name, /** @type {any} */ (tensor).data]));
    },
  };
}
