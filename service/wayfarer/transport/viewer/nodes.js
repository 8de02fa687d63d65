// The other nodes of the cluster that this page came from.

/**
 * Their addresses: those that the page's policy lets it call; none where the server is no cluster.
 * @param {{ href: string, protocol: string, host: string }} [page] @param {typeof fetch} [ask]
 * @returns {Promise<string[]>}
 */
export async function otherNodes(page = location, ask = fetch) {
  const answer = await ask(page.href, { method: "HEAD" });
  const policy = answer.headers.get("content-security-policy") ?? "";
  const called = /connect-src ([^;]*)/.exec(policy)?.[1].split(" ") ?? [];
  const places = called.filter((place) => /^[\w.-]+:\d+$/.test(place) && place !== page.host);
  return places.map((place) => `${page.protocol}//${place}`);
}
