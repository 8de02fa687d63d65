// The key or token of a server that asks for one: typed once, kept for this tab. No DOM but storage.

const KEPT_AS = "wayfarer.token";
const PROTOCOL = "wayfarer.v1";

export class Access {
  /** `ask(reason)` lets the user type a token: a promise of it. */
  constructor(ask, storage = globalThis.sessionStorage) {
    this.ask = ask;
    this.storage = storage;
    this.asking = null;
  }

  get token() {
    return this.storage.getItem(KEPT_AS) ?? "";
  }

  /** A token in place of `refused`; many callers, one question. */
  async renew(refused, reason) {
    if (this.token !== refused) return; // somebody else has just asked
    this.asking ??= this.ask(reason).finally(() => {
      this.asking = null;
    });
    this.storage.setItem(KEPT_AS, await this.asking);
  }

  get headers() {
    return this.token ? { authorization: `Bearer ${this.token}` } : {};
  }

  /** Subprotocols of a WebSocket: the only place where a page can put a token. */
  get protocols() {
    return this.token ? [PROTOCOL, `wayfarer.token.${base64url(this.token)}`] : [PROTOCOL];
  }
}

function base64url(text) {
  return btoa(text).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
}
