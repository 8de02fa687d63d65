// The buttons that save something: a file of motion, a film, a link.

import { byId } from "./hud.js";
import { Film, saveMotion } from "./record.js";
import { momentLink, shareLink, showLink } from "./share.js";

/** `people()` returns the selected people, `mesh(agent, detail)` [URL of the body, headers]. */
export function saveButtons({ api, session, place, crowd, stage, timeline, history, mesh, attempt, people }) {
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
  for (const kind of ["glb", "vrma"]) {
    byId(`save-${kind}`).onclick = attempt(() => {
      if (!people().length) throw new Error("Select a person first: it is saved with its motion");
      if (kind === "vrma" && people().length > 1) throw new Error("A VRM animation is of one person: select one");
      const to = timeline.moment ?? history.last;
      return saveMotion(kind, people(), history, to - Number(byId("span").value), to, mesh, crowd.boneNames);
    });
  }
  byId("share").onclick = attempt(async () => {
    const link = session.watchOnly ? momentLink(api, timeline.moment ?? history.last) : await shareLink({ api, session, place, crowd, stage, timeline, history });
    showLink(link, (await api.call("GET", "/v1/models")).models.filter((model) => !model.in_use).map(({ name }) => name));
  });
}
