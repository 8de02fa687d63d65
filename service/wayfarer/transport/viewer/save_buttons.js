// The buttons that make something to keep: a file of motion, a film, a link.

import { byId } from "./hud.js";
import { Film, saveMotion } from "./record.js";
import { shareLink, showLink } from "./share.js";

/** `person()`: who is selected, or null; `mesh(agent, detail)`: [URL of its body, headers]. */
export function saveButtons({ api, session, place, crowd, stage, timeline, history, mesh, attempt, person }) {
  const say = (text, runs = true) => {
    byId("film").textContent = text;
    byId("film").setAttribute("aria-pressed", String(runs));
  };
  const film = new Film(stage.canvas, (seconds) => say(`End film (${seconds} s)`));
  byId("film").onclick = attempt(async () => {
    if (film.runs) {
      say("Film", false);
      await film.end();
    } else {
      film.begin();
      say("End film");
    }
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
