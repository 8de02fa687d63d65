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

/** Let the user copy it. */
export function showLink(address) {
  byId("share-address").value = address;
  byId("share-copy").onclick = async () => {
    byId("share-address").select();
    try {
      await navigator.clipboard.writeText(address);
      byId("share-copy").textContent = "Copied";
    } catch {
      byId("share-copy").textContent = "Press Ctrl-C"; // it is selected; the browser does not let the page
    }
  };
  byId("share-copy").textContent = "Copy";
  byId("share-link").showModal();
}
