// The key or token of a server that asks for one.

const PROTOCOL = "wayfarer.v1";

/** The caller's credentials. */
export class Access {
  /** @type {Promise<string> | null} */
  #asking = null;

  /**
   * `token`: an API key or a JWT. `ask(reason)`: a promise of another one when the server refuses it. Without `ask`,
   * the refused call fails.
   * @param {string} [token] @param {((reason: string) => Promise<string>) | null} [ask]
   */
  constructor(token = "", ask = null) {
    this.token = token;
    this.ask = ask;
  }

  /**
   * Gets a token in place of `refused`; many callers share one question. False when there is no `ask`.
   * @param {string} refused @param {string} reason @returns {Promise<boolean>}
   */
  async renew(refused, reason) {
    if (this.token !== refused) return true; // another call has just asked
    if (!this.ask) return false;
    this.#asking ??= this.ask(reason).finally(() => {
      this.#asking = null;
    });
    this.token = await this.#asking;
    return true;
  }

  /** Headers of an HTTP call. @returns {Record<string, string>} */
  get headers() {
    return this.token ? { authorization: `Bearer ${this.token}` } : {};
  }

  /** Subprotocols of a WebSocket: the only place where a page can put a token. */
  get protocols() {
    return this.token ? [PROTOCOL, `wayfarer.token.${base64url(this.token)}`] : [PROTOCOL];
  }
}

/** @param {string} text */
function base64url(text) {
  return btoa(text).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}
