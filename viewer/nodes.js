// The nodes of the cluster that this page came from.

const SECONDS = 3; // between two requests, so that a node is known even before its neighbour dies

/**
 * Keeps `homes.others` up to date from now on: when the page's node ends, they have its sessions.
 * @param {import("../../../../clients/web/src/core/homes.js").Homes} homes
 */
export async function watchNodes(homes, look = nodesOf, pause = sleep) {
  for (;;) {
    try {
      const nodes = await look(homes.entry);
      if (!nodes.length) return; // no cluster
      homes.others = nodes.filter((node) => node !== homes.entry);
    } catch {
      // no answer: the next call that gets none asks another node, and so will this
    }
    await pause(SECONDS);
  }
}

/**
 * Addresses of the nodes that the node at `entry` knows, including itself, the latest first. They are in the policy of any node's
 * page; there are none if the server is no cluster.
 * @param {string} entry @param {typeof fetch} [ask] @returns {Promise<string[]>}
 */
export async function nodesOf(entry, ask = fetch) {
  const answer = await ask(`${entry}/`, { method: "HEAD" });
  const policy = answer.headers.get("content-security-policy") ?? "";
  const called = /connect-src ([^;]*)/.exec(policy)?.[1].split(" ") ?? [];
  const places = called.filter((place) => /^[\w.-]+:\d+$/.test(place));
  return places.reverse().map((place) => `${new URL(entry).protocol}//${place}`);
}

/**
 * Tells the user where to continue when the page's policy forbids a call: the page was opened before that machine had joined.
 * @param {(text: string) => void} tell @param {() => string | null} session its id @param {EventTarget} [page]
 */
export function watchPolicy(tell, session, page = document) {
  page.addEventListener("securitypolicyviolation", (event) => {
    const { effectiveDirective, blockedURI } = /** @type {SecurityPolicyViolationEvent} */ (event);
    if (effectiveDirective !== "connect-src" || !URL.canParse(blockedURI)) return;
    const { origin, host } = new URL(blockedURI), id = session();
    tell(`This page may not call ${host}, a machine that came after it was opened. Go on at ${origin}/${id ? `?session=${id}` : ""}`);
  });
}

const sleep = (/** @type {number} */ seconds) => new Promise((done) => setTimeout(done, 1000 * seconds));
