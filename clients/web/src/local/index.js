// Local mode: people walk in a page without a server, on onnxruntime-web.

export { LocalSession } from "./session.js";
export { LocalWorld } from "./world.js";
