// The graphs of an export, opened in onnxruntime-web on WASM: one thread, no network beyond the export's own files.

const WEIGHTS = "weights.bin", FLOATS = "weights.f32";

/** Reads a file of the export. @typedef {(name: string) => Promise<ArrayBuffer>} Read */
/** As much of onnxruntime-web as is used. @typedef {any} Runtime */

/**
 * Read a folder that `wayfarer export --for web` has written, and open its graphs. All files are asked for at once.
 * @param {Read} read @param {Runtime | Promise<Runtime>} runtime onnxruntime-web
 * @returns {Promise<{ about: any, bodies: Record<string, ArrayBuffer>, run: import("./world.js").Run }>}
 */
export async function openExport(read, runtime) {
  const about = JSON.parse(new TextDecoder().decode(await read("wayfarer.json")));
  const genders = Object.keys(about.bodies ?? {});
  if (!genders.length) throw new Error("wayfarer.json: no bodies: make the folder with wayfarer export --for web");
  const shares = WEIGHTS in about.files;
  const [ort, weights, parts, graphs] = await Promise.all([
    runtime, shares ? read(WEIGHTS) : null,
    Promise.all(genders.map((gender) => read(about.bodies[gender].file))),
    Promise.all(genders.map((gender) => read(`step_${gender}.onnx`))),
  ]);
  const bodies = Object.fromEntries(genders.map((gender, k) => [gender, parts[k]]));
  const externalData = weights ? [{ path: FLOATS, data: new Uint8Array(widened(weights).buffer) }] : [];
  /** @type {Map<string, any>} */
  const sessions = new Map();
  for (const [k, gender] of genders.entries()) {
    // there is nothing to optimise in these graphs, and to look takes a third of the time
    const options = { executionProviders: ["wasm"], graphOptimizationLevel: "disabled", externalData };
    sessions.set(gender, await ort.InferenceSession.create(new Uint8Array(graphs[k]), options));
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

/** float32 of float16: see weights.py of the exporter. @param {ArrayBuffer} bytes */
function widened(bytes) {
  const table = Float32Array.from({ length: 65536 }, (_, bits) => {
    const power = (bits >> 10) & 31, part = bits & 1023;
    const size = power ? 2 ** (power - 15) * (1 + part / 1024) : 2 ** -24 * part;
    return bits & 32768 ? -size : size;
  });
  const halves = new Uint16Array(bytes), floats = new Float32Array(halves.length);
  for (let k = 0; k < halves.length; k += 1) floats[k] = table[halves[k]];
  return floats;
}
