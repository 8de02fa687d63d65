// Buttons, figures and messages: everything on the page that is not the stage.

const MESSAGE_SECONDS = 6;
const NEWS_SECONDS = 5;
const NEWS_LINES = 4;
const FIGURE_SECONDS = 0.5;

/** A connection that is being made again. */
export const LOST = "The connection is lost. People go on when the server is back.";

export const byId = (id) => document.getElementById(id);

/** Shows a message to the user, an error unless `note`. The same text is not shown twice at once. */
export function tell(text, note = false) {
  const box = byId("messages");
  if ([...box.children].some((shown) => shown.textContent === text)) return;
  const line = document.createElement("p");
  line.textContent = text;
  if (note) line.className = "note";
  box.append(line);
  setTimeout(() => line.remove(), MESSAGE_SECONDS * 1000);
}

/** Shows a quiet line that disappears by itself; only the latest of a kind is shown. */
export function mention(text, kind = text) {
  const box = byId("news");
  for (const shown of [...box.children]) if (shown.dataset.kind === kind) shown.remove();
  const line = document.createElement("p");
  line.textContent = text;
  line.dataset.kind = kind;
  box.append(line);
  while (box.children.length > NEWS_LINES) box.firstChild.remove();
  setTimeout(() => line.remove(), NEWS_SECONDS * 1000);
}

/** Asks the user for the key or token that the server needs. */
export function askToken(reason) {
  const dialog = byId("access");
  byId("access-reason").textContent = reason;
  byId("access-token").value = "";
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.onclose = () => {
      const token = byId("access-token").value.trim();
      if (token) resolve(token);
      else dialog.showModal(); // without a page behind it there is nothing to show
    };
  });
}

export function showConnection(state, text) {
  const line = byId("connection");
  line.dataset.state = state;
  line.textContent = text;
  line.classList.remove("busy");
}

/** Shows whether the server of an open connection is short of time. */
function showBusy(busy) {
  const line = byId("connection");
  if (!/^(connected|busy)$/.test(line.textContent)) return;
  line.textContent = busy ? "busy" : "connected";
  line.classList.toggle("busy", busy);
}

/** Shows all keys, and how the stage is used, in the words of the controls themselves. */
export function showHelp(stage) {
  byId("keys").replaceChildren(...[...document.querySelectorAll("[title^='Key: ']")].flatMap((control) => {
    const [, key] = /^Key: (.+?)(\.|,|$)/.exec(`${control.title} `.replace("Key: ,", "Key: comma").replace("Key: .", "Key: full stop"));
    const [name, what] = [document.createElement("dt"), document.createElement("dd")];
    name.textContent = key.trim();
    what.textContent = control.ariaLabel || control.innerText.trim() || control.textContent.trim();
    return [name, what];
  }));
  byId("help-stage").textContent = stage;
  byId("help-dialog").showModal();
}

/** Shows the legend of a comparison: texts for the people and for the blue ones over them; null: none. */
export function showLegend(texts) {
  byId("legend").hidden = !texts;
  for (const [k, id] of ["legend-plain", "legend-beside"].entries()) byId(id).textContent = texts?.[k] ?? "";
}

/** Shows the reason why the page does not work until it is null. */
export function showTrouble(title, text = "") {
  byId("trouble").hidden = title === null;
  if (title === null || byId("trouble-title").textContent === title) return;
  byId("trouble-title").textContent = title;
  byId("trouble-text").textContent = text;
}

/** Shows the controls that a first look does not need, or hides them. */
export function disclose(all) {
  for (const part of ["rest", "place", "readout"]) byId(part).hidden = !all;
  byId("more").setAttribute("aria-expanded", String(all));
  byId("more").textContent = all ? "Less" : "More";
  document.body.classList.toggle("all", all);
}

/** Lists people and groups; `selection` is chosen in the list. */
export function listPeople(people, selection) {
  const list = byId("selected");
  const several = selection.people.length > 1;
  const options = people.map((person) => {
    const { alias, name } = person.agent;
    return new Option(`${name || "agent"} · ${alias}`, String(alias), false, !several && person === selection.person);
  });
  const groups = selection.groups.flatMap((group, k) => (group.length ? [new Option(`group ${k + 1} · ${group.length} people`, `group ${k + 1}`)] : []));
  const chosen = several ? [new Option(`${selection.people.length} people`, "several", false, true)] : [];
  list.replaceChildren(new Option("nobody", "", false, !selection.person), ...chosen, ...groups, ...options);
  byId("chosen").hidden = !selection.person;
  byId("pitch").hidden = Boolean(selection.person); // it says that the nearest person goes
  byId("chosen-name").textContent = several ? `${selection.people.length} people are selected.` : `${selection.person?.agent.name || "One person"} is selected.`;
  byId("remove").disabled = !selection.person;
  byId("keep-group").disabled = !several;
}

/** Writes the figures a few times per second; counts frames on the way. */
export class Readout {
  #frames = 0;
  #since = null;

  /** Counts a frame; when it is time to write, asks `figures()` and returns the fps. */
  frame(now, figures) {
    this.#since ??= now;
    this.#frames += 1;
    if (now - this.#since < FIGURE_SECONDS) return null;
    const fps = this.#frames / (now - this.#since);
    this.#frames = 0;
    this.#since = now;
    const { people, delay, buffered, busy, told } = figures();
    byId("figure-people").textContent = people;
    byId("figure-fps").textContent = fps.toFixed(0);
    byId("figure-delay").textContent = delay === null ? "–" : milliseconds(delay);
    byId("figure-buffer").textContent = Number.isFinite(buffered) ? milliseconds(Math.max(0, buffered)) : "–";
    byId("pitch-people").textContent = told;
    showBusy(busy);
    return fps;
  }

  /** The server's figures, or null when it does not answer. */
  stats(stats) {
    byId("figure-step").textContent = stats
      ? `${stats.step_ms_mean.toFixed(1)} / ${stats.step_ms_p95.toFixed(1)} ms`
      : "–";
    byId("figure-late").textContent = stats?.late_chunks ?? "–";
  }
}

function milliseconds(seconds) {
  return `${Math.round(seconds * 1000)} ms`;
}
