// The worker of a local session: calls come from session.js as { id, call, values }.

import { openHost } from "./load.js";

/** @type {import("./host.js").LocalHost | null} */
let host = null;

/** @param {any} message @param {Transferable[]} [moved] */
const post = (message, moved = []) => /** @type {any} */ (globalThis).postMessage(message, moved);

/** @param {any} message */
function tell(message) {
  post(message, message.kind === "chunk" ? [message.frames.buffer, message.contacts.buffer] : []);
}

globalThis.addEventListener("message", async ({ data: { id, call, values } }) => {
  try {
    let result;
    if (call === "open") {
      host = await openHost(values[0], tell, (bytes) => post({ kind: "loaded", bytes }));
    } else if (host) {
      result = /** @type {any} */ (host)[call](...values);
    }
    post({ kind: "answer", id, result });
  } catch (error) {
    post({ kind: "answer", id, error: String(/** @type {Error} */ (error).message) });
  }
});
