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

  /** Asks another address in place of the entry from now on. */
  turn() {
    this.others.push(this.entry);
    this.entry = /** @type {string} */ (this.others.shift());
  }

  /** The address for calls about the id in `about`. @param {string} about */
  home(about) {
    return this.#homes.get(slotOf(about)) ?? this.entry;
  }

  /** A node's address, by the entry's scheme. `host`: "" is the entry's. @param {string} host @param {number} port */
  node(host, port) {
    const [, scheme, own] = /** @type {RegExpExecArray} */ (/^(https?:\/\/|)(\[[^\]]*\]|[^:/]*)/.exec(this.entry));
    const name = host.includes(":") && !host.startsWith("[") ? `[${host}]` : host; // IPv6
    return `${scheme}${name || own}:${port}`;
  }

  /** Notes that the slot of `about` lives at `address`. @param {string} about @param {string} address */
  learn(about, address) {
    const slot = slotOf(about);
    if (slot) this.#homes.set(slot, address);
  }

  /** Forgets where it lives; only the entry knows. @param {string} about */
  forget(about) {
    this.#homes.delete(slotOf(about));
  }

  /** The route of a call. `about`: text with the id that it concerns; "": none. @param {string} about */
  route(about) {
    return new Route(this, about);
  }
}

/**
 * The addresses to which a call or a stream goes in turn: `address` is the next one. At most four: the known node, the
 * node it names, the entry, and the node that the entry names; and two more for each of `Homes.others`.
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

  /** Starts again, as for a new call. */
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
   * Notes that `address` has named another node; returns whether the call continues there.
   * @param {string} host @param {number} port 0, or an invalid host name: it has named none
   */
  misdirected(host, port) {
    if (this.#followed || !(port > 0 && port < 1 << 16) || !/^[\w.:[\]-]*$/.test(host)) return this.#ask();
    this.#followed = true;
    this.address = this.#homes.node(host, port);
    this.#homes.learn(this.#about, this.address);
    return true;
  }

  /** Notes that `address` does not answer at present; returns as `misdirected`. */
  unavailable() {
    return this.#ask();
  }

  /**
   * Notes that a call was refused with an HTTP status (0: no answer). Returns whether it continues.
   * @param {number} status @param {{ host?: string, http_port?: number }} [endpoint] of the problem
   */
  refused(status, { host = "", http_port = 0 } = {}) {
    if (status === 421) return this.misdirected(host, http_port);
    return (status === 0 || status === 503) && this.unavailable();
  }

  /** Notes that a stream has ended; returns whether to connect to `address` at once. @param {number} code @param {string} reason */
  closed(code, reason) {
    const { host, port } = placeOf(reason);
    if (code === 4421) return this.misdirected(host, port);
    this.unavailable(); // its node may have left the cluster; in any case do not connect at once
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
