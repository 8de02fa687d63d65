// The buttons that make something to keep: a file of motion, a film, a link.

import { byId } from "./hud.js";
import { Film, saveMotion } from "./record.js";
import { shareLink, showLink } from "./share.js";

/** `person()`: who is selected, or null; `mesh(agent, detail)`: [URL of its body, headers]. */
export function saveButtons({ api, session, place, crowd, stage, timeline, history, mesh, attempt, person }) {
  const film = new Film(stage.canvas);
  byId("film").onclick = attempt(() => {
    film.toggle();
    byId("film").textContent = film.runs ? "End film" : "Film";
    byId("film").setAttribute("aria-pressed", String(film.runs));
  });
  byId("save-glb").onclick = attempt(() => {
    if (!person()) throw new Error("Select a person first: it is saved with its motion");
    const to = timeline.moment ?? history.last;
    return saveMotion(person(), history, to - Number(byId("span").value), to, mesh, crowd.boneNames);
  });
  byId("share").onclick = attempt(async () => {
    showLink(session.watchOnly ? location.href : await shareLink({ api, session, place, crowd, stage }));
  });
}
