// Where a call goes when a server is many nodes: the rule of clients/README.md, "Many nodes".

/** The nodes at which sessions, scenes and agents live, as far as is known. */
export class Homes {
  /** Addresses by slot. @type {Map<string, string>} */
  #homes = new Map();

  /** @param {string} entry the server's address, "http://host:port" or "host:port" */
  constructor(entry) {
    this.entry = entry;
    /** Addresses to ask when `entry` does not answer, in turn. @type {string[]} */
    this.others = [];
  }

  /** From now on another one is asked in place of the entry. */
  turn() {
    this.others.push(this.entry);
    this.entry = /** @type {string} */ (this.others.shift());
  }

  /** The address at which the one whose id is in `about` is called. @param {string} about */
  home(about) {
    return this.#homes.get(slotOf(about)) ?? this.entry;
  }

  /** A node's address, by the entry's scheme. `host`: "" is the entry's. @param {string} host @param {number} port */
  node(host, port) {
    const [, scheme, own] = /** @type {RegExpExecArray} */ (/^(https?:\/\/|)(\[[^\]]*\]|[^:/]*)/.exec(this.entry));
    const name = host.includes(":") && !host.startsWith("[") ? `[${host}]` : host; // IPv6
    return `${scheme}${name || own}:${port}`;
  }

  /** They live there. @param {string} about @param {string} address */
  learn(about, address) {
    const slot = slotOf(about);
    if (slot) this.#homes.set(slot, address);
  }

  /** Nobody knows where they live, but the entry. @param {string} about */
  forget(about) {
    this.#homes.delete(slotOf(about));
  }

  /** Where a call goes. `about`: text with the id of whom it concerns; "": nobody's. @param {string} about */
  route(about) {
    return new Route(this, about);
  }
}

/**
 * The addresses that a call, or a stream, goes to in turn: `address` is the next one. At most four: the node that is
 * known, the one that it names, the entry, the one that it names; and two more for each of `Homes.others`.
 */
export class Route {
  #homes;
  #about;
  #asked = false; // the entry
  #followed = false;
  #turns = 0;
  address = "";

  /** @param {Homes} homes @param {string} about */
  constructor(homes, about) {
    this.#homes = homes;
    this.#about = about;
    this.begin();
  }

  /** Start again: as for a new call. */
  begin() {
    this.address = this.#homes.home(this.#about);
    this.#asked = this.address === this.#homes.entry;
    this.#followed = false;
    this.#turns = 0;
  }

  /** The call has succeeded, or the stream has begun. @param {string} [made] id of what was made by it */
  answered(made = "") {
    if (this.address !== this.#homes.entry) this.#homes.learn(slotOf(made) ? made : this.#about, this.address);
    this.begin();
  }

  /**
   * `address` has named another node; whether the call goes on, to the new `address`.
   * @param {string} host @param {number} port 0, or what is no host's name: it has named none
   */
  misdirected(host, port) {
    if (this.#followed || !(port > 0 && port < 1 << 16) || !/^[\w.:[\]-]*$/.test(host)) return this.#ask();
    this.#followed = true;
    this.address = this.#homes.node(host, port);
    this.#homes.learn(this.#about, this.address);
    return true;
  }

  /** `address` does not answer, or not at present; as `misdirected`. */
  unavailable() {
    return this.#ask();
  }

  /**
   * A call was refused, by an HTTP status (0: no answer); whether it goes on.
   * @param {number} status @param {{ host?: string, http_port?: number }} [endpoint] of the problem
   */
  refused(status, { host = "", http_port = 0 } = {}) {
    if (status === 421) return this.misdirected(host, http_port);
    return (status === 0 || status === 503) && this.unavailable();
  }

  /** A stream has ended; whether to connect to `address` at once. @param {number} code @param {string} reason */
  closed(code, reason) {
    const { host, port } = placeOf(reason);
    if (code === 4421) return this.misdirected(host, port);
    this.unavailable(); // in a cluster its node is gone, perhaps; in any case not at once
    return false;
  }

  #ask() {
    this.#homes.forget(this.#about);
    if (this.#asked) {
      if (this.#turns++ === this.#homes.others.length) return false;
      this.#homes.turn();
    }
    this.#asked = true;
    this.#followed = false;
    this.address = this.#homes.entry;
    return true;
  }
}

/** The slot of the first id in a text, which a session and its agents share; "" without one. @param {string} about */
const slotOf = (about) => /(?:session|scene|agent)-([0-9a-f]{4})/.exec(about)?.[1] ?? "";

/** Host and port that the close reason of a stream names (code 4421); port 0: none. @param {string} reason */
export function placeOf(reason) {
  const found = /^call (.*):(\d{1,5})$/.exec(reason);
  return found ? { host: found[1], port: Number(found[2]) } : { host: "", port: 0 };
}
