// A link to what is shown, for somebody else.

import { byId } from "./hud.js";
import { encodeScript, scriptOf } from "./script.js";

/** The address of a script of what is there now. Throws when it cannot be shared. */
export async function shareLink({ api, session, place, crowd, stage }) {
  const choice = place.choices.find(({ value }) => value === place.value);
  if (place.value && !choice?.example) throw new Error("Only example scenes can be shared: a level of yours is not in a link");
  const script = scriptOf({
    scene: choice?.example ?? "",
    crates: place.book.obstacles,
    agents: await api.agents(session.id),
    people: crowd.people,
    camera: { eye: stage.camera.position.toArray(), target: stage.controls.target.toArray() },
  });
  const url = new URL(location.pathname, location.href);
  url.hash = `replay=${await encodeScript(script)}`;
  return url.href;
}

/** The address of the replay that is shown, from a moment of it on. */
export function momentLink(moment) {
  return changed(location.href, "at", Number.isFinite(moment) && moment > 0 ? moment.toFixed(2) : "");
}

/** Let the user choose what else is in it, and copy it or look at it. */
export function showLink(address) {
  const shown = byId("share-address"), beside = byId("share-beside");
  shown.value = address;
  beside.value = new URLSearchParams(new URL(address).hash.slice(1)).get("beside") ?? "";
  beside.onchange = () => {
    shown.value = changed(shown.value, "beside", beside.value);
    byId("share-copy").textContent = "Copy";
  };
  byId("share-open").onclick = () => window.open(shown.value, "_blank", "noopener");
  byId("share-copy").onclick = async () => {
    shown.select();
    try {
      await navigator.clipboard.writeText(shown.value);
      byId("share-copy").textContent = "Copied";
    } catch {
      byId("share-copy").textContent = "Press Ctrl-C"; // it is selected; the browser does not let the page
    }
  };
  byId("share-copy").textContent = "Copy";
  byId("share-link").showModal();
}

/** An address with a part of its hash set; "": without it. */
function changed(address, name, value) {
  const url = new URL(address);
  const parts = new URLSearchParams(url.hash.slice(1));
  if (value) parts.set(name, value);
  else parts.delete(name);
  url.hash = parts;
  return url.href;
}
