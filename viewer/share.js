// A link to the present contents of the page, for other people.

import { byId } from "./hud.js";
import { pastOf } from "./packed_past.js";
import { encodeScript, scriptOf } from "./script.js";

const LONGEST = 64_000; // maximum characters of an address with the past; without it, ten people take some 1,200

/** The address of a script of the moment shown, with the past until then: { address, past, seconds }. Throws if it cannot be shared. */
export async function shareLink({ api, session, place, crowd, stage, timeline, history }) {
  const choice = place.choices.find(({ value }) => value === place.value);
  if (place.value && !choice?.example) throw new Error("Only example scenes can be shared: a level of yours is not in a link");
  const { live } = timeline;
  const moment = live ? history.last : timeline.moment;
  timeline.pause(); // while the script is packed
  try {
    const agents = await api.agents(session.id), known = new Set(agents.map(({ agent_id: id }) => id));
    const people = crowd.people.filter(({ agent, shown }) => shown && known.has(agent.id));
    const script = await encodeScript(scriptOf({
      scene: choice?.example ?? "",
      crates: place.book.obstacles,
      agents,
      people,
      camera: { eye: stage.camera.position.toArray(), target: stage.controls.target.toArray() },
    }));
    const url = new URL(location.pathname, api.homes.entry); // a node of the cluster that answers
    const { text, seconds } = await pastOf(people, history, moment, LONGEST - url.href.length - script.length - 20);
    url.hash = `replay=${script}`;
    return { address: url.href, past: text, seconds };
  } finally {
    if (live) timeline.goLive();
  }
}

/** The address of the replay that is shown, from a moment of it on. */
export function momentLink(api, moment) {
  const { pathname, search, hash } = location;
  const { href } = new URL(pathname + search + hash, api.homes.entry);
  return { address: changed(href, "at", Number.isFinite(moment) && moment > 0 ? moment.toFixed(2) : ""), past: "", seconds: null };
}

/** Offers a choice of further contents, and to copy or open the link. `models`: names of other loaded models. */
export function showLink({ address, past, seconds }, models) {
  const shown = byId("share-address"), beside = byId("share-beside"), before = byId("share-past");
  byId("share-models").replaceChildren(...models.map((name) => new Option(name, `model:${name}`)));
  byId("share-models").hidden = !models.length;
  byId("share-tells").textContent = seconds === null
    ? "It goes on from the moment shown." : "It shows these people going on for 30 seconds, made again from their seeds and goals: alike each time on the same server.";
  before.parentNode.hidden = !past;
  before.checked = false;
  byId("share-seconds").textContent = `the last ${(seconds ?? 0).toFixed(1)} s before, as you saw them (${Math.ceil(past.length / 1000)},000 characters)`;
  shown.value = address;
  beside.value = new URLSearchParams(new URL(address).hash.slice(1)).get("beside") ?? "";
  const change = (name, value) => {
    shown.value = changed(shown.value, name, value);
    byId("share-copy").textContent = "Copy";
  };
  beside.onchange = () => change("beside", beside.value);
  before.onchange = () => change("past", before.checked ? past : "");
  byId("share-open").onclick = () => window.open(shown.value, "_blank", "noopener");
  byId("share-copy").onclick = async () => {
    shown.select();
    try {
      await navigator.clipboard.writeText(shown.value);
      byId("share-copy").textContent = "Copied";
    } catch {
      byId("share-copy").textContent = "Press Ctrl-C"; // it is selected; the browser does not allow the page to copy
    }
  };
  byId("share-copy").textContent = "Copy";
  byId("share-link").showModal();
}

/** An address with a part of its hash set; "": without that part. */
function changed(address, name, value) {
  const url = new URL(address);
  const parts = new URLSearchParams(url.hash.slice(1));
  if (value) parts.set(name, value);
  else parts.delete(name);
  url.hash = parts;
  return url.href;
}
