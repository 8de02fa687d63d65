// Puts the page together: session, scene, stage, controls.

import { Access, Api, BONES, clock } from "./client/index.js";
import { Arrivals } from "./arrivals.js";
import { watchSleep } from "./asleep.js";
import { Camera } from "./camera.js";
import { crowdText, eventText } from "./choices.js";
import { Crowd } from "./crowd.js";
import { Drive } from "./drive.js";
import { Commands } from "./commands.js";
import { kindOf, watchFiles } from "./files.js";
import { History } from "./history.js";
import { askToken, byId, disclose, listPeople, LOST, mention, Readout, showConnection, showHelp, showTrouble, tell } from "./hud.js";
import { watchKeys } from "./keyboard.js";
import { watchNodes, watchPolicy } from "./nodes.js";
import { Overlays } from "./overlays.js";
import { ScenePanel } from "./panel.js";
import { decodePast } from "./packed_past.js";
import { floorRing } from "./people.js";
import { watchPointer } from "./pointer.js";
import { bringBack, remember, restoreText } from "./restore.js";
import { NoPicture, Stage } from "./scene.js";
import { Selection } from "./selection.js";
import { saveButtons } from "./save_buttons.js";
import { decodeScript } from "./script.js";
import { PageSession } from "./session.js";
import { viewpoints } from "./sight.js";
import { watchStick } from "./stick.js";
import { Timeline } from "./timeline.js";
import { TimelineBar } from "./timeline_bar.js";
import { Tools } from "./tools.js";
import { Wardrobe } from "./wardrobe.js";

const AHEAD = 250; // maximum ms for which the stage waits until the first people have their commands
const DETAILED = 24; // maximum number of people with the fine mesh, on a machine that draws well
const FIRST_SCENE = "town_square"; // if no other is requested
const MORE = 8; // people who come with the button
const RESTART_SECONDS = 0.5;
const STATS_SECONDS = 1;
const WANDER_SECONDS = 1;
const TOKEN = "wayfarer.token";

const attempt = (action) => (...given) => (
  Promise.resolve().then(() => action(...given)).catch((error) => (error.status === 0 ? mention(LOST) : tell(error.message)))
);
const page = new URLSearchParams(location.search);
const query = Object.fromEntries(["encoding", "fps"].filter((key) => page.has(key)).map((key) => [key, page.get(key)]));
const view = byId("view");

const access = new Access(sessionStorage.getItem(TOKEN) ?? "", async (reason) => {
  const token = await askToken(reason);
  sessionStorage.setItem(TOKEN, token); // typed once, kept for this tab
  return token;
});
const api = new Api(new URL(".", location.href).href.replace(/\/$/, ""), { // a proxy may have put it below a path
  access,
  pause: (seconds) => {
    mention("The server is busy; the page tries again by itself.");
    return new Promise((done) => setTimeout(done, 1000 * seconds));
  },
});
watchNodes(api.homes);
watchPolicy(tell, () => session.id);
const stage = new Stage(view);
const readout = new Readout();
const place = new ScenePanel(api, stage, { enter, chosen: () => welcome(), changed: attempt(() => commands.replan()), attempt });
const { level, book } = place;
const crowd = new Crowd(stage, (x, z, y) => level.heightAt(x, z, y), (agent, detail) => arrivals.mesh(agent, detail), refresh, tell);
stage.canvas.addEventListener("webglcontextrestored", () => crowd.names.forget());
const session = new PageSession(api, crowd, query, clock, { event: onEvent, ended: onEnded });
const commands = new Commands(api, crowd, {
  ask: () => {
    if (session.watchOnly) throw new Error("This is a replay: open the page without the link to send people");
    return { mode: sendMode(), selected: selection.people, speed: Number(byId("speed").value), formation: byId("formation").value };
  },
  heightAt: (x, z, y) => level.heightAt(x, z, y),
  scene: () => session.scene,
  nobody: () => arrivals.nobody,
});
const selection = new Selection(() => showSelection());
const tools = new Tools({ stage, level, book, crowd, commands, selection, attempt });
const camera = new Camera(stage, level, crowd);
const arrivals = new Arrivals({ api, stage, place, crowd, session, commands, met, detail: page.get("detail") });
const wardrobe = new Wardrobe(api, crowd, {
  enlist: (shape) => arrivals.enlist(shape), walk: attempt((id) => arrivals.setOff(id)), attempt,
});
const cursor = floorRing(0.1, 0.14, "#b02a37");
cursor.visible = false;
stage.add(cursor);

const history = new History();
const timeline = new Timeline(history);
const bar = new TimelineBar(timeline, history, () => selection.person);
const overlays = new Overlays(stage);
const drive = new Drive({ stage, commands, attempt, person: () => selection.person });

let lost = null; // the contents of a session that the server has forgotten
let chosen = []; // ids of people who were selected in it, until they are back
let joining = page.get("session"); // another user's session to show; later this page's own
const shared = new URLSearchParams(location.hash.slice(1)); // share.js
let replaying = shared.get("replay"); // a script to show; used like `joining`
start();

async function start() {
  let welcomed = null;
  try {
    const listed = place.begun ? null : place.list();
    const [{ limits }, all] = await Promise.all([api.info(), api.bodies(), listed]);
    arrivals.bodies = new Map(all.map((body) => [body.gender, body]));
    byId("count").max = Math.min(200, limits.agents_per_session);
    byId("count").oninput({ target: byId("count") }); // its meaning may be smaller now
    const watched = joining && await othersSession(joining);
    const replay = replaying && !watched ? await replayed() : null;
    if (watched) await place.attend(watched.scene);
    else if (replay) await place.attend(replay.scene, replay.script.scene);
    else await place.begin(place.value ?? page.get("scene") ?? FIRST_SCENE);
    showTrouble(null);
    if (replay) stage.lookFrom(replay.script.camera);
    const anew = !watched && !replay && !place.begun;
    place.begun = true;
    let sent;
    const requested = new Promise((go) => {
      sent = () => setTimeout(go); // a request is sent after the task that makes it
      setTimeout(go, anew ? AHEAD : 0);
    });
    welcomed = anew ? welcome(sent) : null;
    await Promise.race([requested, welcomed].filter(Boolean)); // people walk and are dressed by the server while the stage is made
    beginStage();
    await welcomed;
    if (lost && !watched) {
      stage.lookFrom(lost.view);
      if (lost.people.length) arrivals.expect();
      chosen = await bringBack(lost, { api, session, book, crowd, commands }).catch((error) => {
        if (error.status) { // a refusal would be repeated
          lost = null;
          arrivals.forget();
        }
        throw error;
      });
      lost = null;
    }
  } catch (error) {
    if (error instanceof NoPicture) {
      await welcomed;
      showNoPicture();
      return;
    }
    beginStage();
    if (welcomed && error.status === 0) place.begun = false; // perhaps nobody has come: people are welcomed again
    showConnection("lost", `${error.message}; trying again`);
    showTrouble(...reasonOf(error));
    setTimeout(start, 2000);
  }
}

function beginStage() {
  stage.begin(show, page.has("look") ? Number(page.get("look")) : null);
}

/** Headline and text for the reason why the page cannot begin. */
function reasonOf({ status, message }) {
  const again = "This page tries again every two seconds.";
  if (status === 0) return ["The server does not answer", `Start it with “wayfarer serve”. ${again}`];
  if (status === 503) return ["The server is starting", "The first start on a machine takes about half a minute. This page opens by itself."];
  return [message, again];
}

function showNoPicture() {
  session.leave();
  showConnection("lost", "not connected");
  showTrouble(
    "This browser shows no 3D",
    "WebGL 2 is off or missing. Switch on hardware acceleration in the browser's settings, or open the page in another browser.",
  );
}

/** The session in the page's address, if it can be shown; then it is joined. */
async function othersSession(id) {
  try {
    const found = await api.session(id);
    if (found.basis.basis === "gltf") return found;
    tell(`The session is in the basis ${found.basis.basis}; this page shows those in gltf.`);
  } catch (error) {
    if (error.status !== 404) throw error;
    tell(error.message);
  }
  joining = null;
  return null;
}

/** The session of the script in the page's address, if it can be made. */
async function replayed() {
  try {
    const [script, past] = await Promise.all([decodeScript(replaying), shared.has("past") ? decodePast(shared.get("past")) : null]);
    const at = shared.has("at") ? Number(shared.get("at")) || 0 : null;
    return await session.replay(script, { beside: shared.get("beside") ?? "", past, at });
  } catch (error) {
    if (error.status === 0) throw error; // no server
    tell(error.message);
    replaying = null;
    return null;
  }
}

/** Begins a session in a scene, or with "" in none. */
async function enter(scene) {
  arrivals.forget();
  if (commands.wandering) toggleWander();
  tools.use("send");
  timeline.goLive();
  if (joining) session.join(joining, scene);
  else if (!replaying) await session.open(scene); // a replay has been opened
  joining = replaying = null;
}

/** People walk in an example when it opens, unless the page's address says `people=0`. `sent()`: see arrivals.js. */
async function welcome(sent) {
  if (place.isExample && page.get("people") !== "0") await arrivals.welcome(sent);
}

function onEvent(event) {
  const person = crowd.members.get(event.alias);
  if (event.agentId && !person) return; // it has not come yet
  if (person && person === drive.driven) return; // the user drives it
  const goals = person && !person.wanders ? person.passed + person.ahead.length : 0;
  if (/^goal_/.test(event.kind) && !goals) return; // it chose the place itself, or another user did
  const text = eventText(event, person?.agent.name || "somebody", goals);
  if (text) mention(text, event.kind);
}

/** Begins another session after the server has forgotten this one, with its contents if it was the page's own. */
function onEnded(reason) {
  lost ??= session.current.own ? remember(crowd, book, stage, selection.people) : null;
  tell((lost && restoreText(lost)) || `The session has ended (${reason}). A new one begins.`, true);
  setTimeout(start, RESTART_SECONDS * 1000);
}

function refresh() {
  commands.notice();
  const back = crowd.people.filter(({ agent }) => chosen.includes(agent.id));
  if (back.length && back.length === chosen.length) {
    chosen = [];
    selection.choose(back);
  }
  if (selection.prune(new Set(crowd.people))) showSelection();
  else listPeople(crowd.people, selection);
}

function showSelection() {
  const { people } = selection;
  camera.release();
  const mode = sendMode();
  if (people.length && mode === "nearest") setSendMode("selected");
  if (!people.length && mode === "selected") setSendMode("nearest");
  for (const person of crowd.people) person.mark(people.includes(person));
  listPeople(crowd.people, selection);
}

/** An expected person has come. */
function met(person) {
  selection.choose([person]);
  camera.follow(true);
}

function sendMode() {
  return document.querySelector("input[name=send]:checked").value;
}

function setSendMode(mode) {
  document.querySelector(`input[name=send][value=${mode}]`).checked = true;
}

// ---- the user's commands; every refusal is shown

const add = attempt((count) => arrivals.create(count));

const remove = attempt(async () => {
  if (tools.name === "crate" && tools.deleteChosen()) return;
  await Promise.all(selection.people.map(({ agent }) => api.deleteAgent(agent.id)));
});

const stop = attempt(async () => {
  const { people } = selection;
  if (!people.length && commands.wandering) toggleWander();
  await commands.stop(people.length ? people : crowd.people);
});

const populate = attempt(async () => {
  mention(crowdText(await api.populate(session.id, Number(byId("count").value))));
});

const wander = attempt(() => commands.wander());
const endWandering = attempt(() => commands.endWandering());

/** Starts or stops driving the selected person. */
function toggleDrive() {
  if (!drive.on) {
    const person = selection.person ?? crowd.nearestTo(stage.controls.target);
    if (!person) return tell(arrivals.nobody, true);
    selection.choose([person]); // only one is driven
  }
  drive.turn(!drive.on);
  byId("drive").setAttribute("aria-pressed", String(drive.on));
  camera.follow(drive.on);
  byId("driving").hidden = !drive.on;
  document.body.classList.toggle("driving", drive.on);
  if (drive.on) mention("W, A, S, D, a gamepad or the stick on a touch screen walk; Esc ends");
}

function toggleWander() {
  commands.wandering = !commands.wandering;
  byId("wander").setAttribute("aria-pressed", String(commands.wandering));
  if (commands.wandering) wander();
  else endWandering();
}

// ---- controls

byId("more-people").onclick = attempt(() => {
  mention(`${MORE} people are coming`, "come"); // a busy server takes seconds to answer
  return arrivals.roamers(MORE);
});
byId("more").onclick = () => {
  disclose(byId("rest").hidden);
  tools.hint();
};
byId("help").onclick = () => showHelp(tools.help);
byId("add-one").onclick = () => add(1);
byId("add-many").onclick = () => add(16);
byId("remove").onclick = remove;
watchFiles([[byId("character-file"), "character"], [byId("level-file"), "level"]], attempt(async (file, purpose) => {
  await (await kindOf(file, purpose) === "character" ? wardrobe : place).take(file);
}));
byId("stop").onclick = stop;
byId("wander").onclick = toggleWander;
byId("populate").onclick = populate;
byId("count").oninput = ({ target }) => {
  byId("count-shown").textContent = target.value;
};
byId("speed").oninput = ({ target }) => {
  byId("speed-shown").textContent = `${Number(target.value).toFixed(1)} m/s`;
};
byId("follow").onchange = ({ target }) => camera.follow(target.checked);
byId("trails").onchange = ({ target }) => crowd.mark("trails", target.checked);
byId("skeletons").onchange = ({ target }) => overlays.mark("skeleton", target.checked);
byId("footprints").onchange = ({ target }) => overlays.mark("feet", target.checked);
byId("drive").onclick = byId("drive-end").onclick = toggleDrive;
watchStick(byId("stick"), (right, forward) => {
  drive.thumb = [right, forward];
});
saveButtons({ api, session, place, crowd, stage, timeline, history, mesh: crowd.mesh, attempt, people: () => selection.people });
byId("labels").onchange = ({ target }) => crowd.mark("labels", target.checked);
byId("selected").onchange = ({ target: { value } }) => {
  const [, group] = /^group (\d+)$/.exec(value) ?? [];
  const person = crowd.members.get(Number(value));
  if (group) selection.recall(Number(group));
  else selection.choose(value && person ? [person] : []);
};
byId("deselect").onclick = () => {
  selection.choose([]);
  view.focus(); // the button is gone
};
byId("keep-group").onclick = () => mention(`Group ${selection.keep()} is kept: its key and the list select it`);
watchPointer(view, stage.controls, {
  press: (event) => (session.watchOnly ? null : tools.press(event)),
  click: (event) => tools.click(event),
});

watchKeys(view, {
  arrow: (dx, dz) => {
    const { x, y, z } = cursor.position;
    cursor.visible = true;
    cursor.position.set(x + dx, level.heightAt(x + dx, z + dz, y) + 0.014, z + dz);
  },
  enter: () => {
    if (tools.name === "patrol" && tools.points.length > 1) tools.use("patrol");
    else if (cursor.visible) tools.act({ x: cursor.position.x, y: cursor.position.y, z: cursor.position.z });
  },
  held: (key) => drive.press(key),
  keys: {
    a: press("add-one"), s: press("add-many"), delete: remove, w: press("wander"), x: press("stop"),
    "?": press("help"), d: press("drive"), k: press("skeletons"), o: press("footprints"),
    " ": () => bar.toggle(), ",": () => timeline.step(-1), ".": () => timeline.step(1),
    f: press("follow"), t: press("trails"), l: press("labels"), p: press("populate"), escape,
    g: () => tools.use("send"), c: () => tools.use("crate"), b: () => tools.use("box"),
    ...Object.fromEntries(Array.from({ length: 9 }, (_, k) => [String(k + 1), () => selection.recall(k + 1)])),
  },
});

/** Ends one thing at a time: the tool, the camera, the selection. */
function escape() {
  if (drive.on) toggleDrive();
  else if (tools.name !== "send") tools.use("send");
  else if (camera.follows) camera.follow(false);
  else selection.choose([]);
}

function press(id) {
  return () => byId(id).click();
}

disclose(page.has("controls"));
tools.hint();
document.body.classList.toggle("embed", page.has("embed"));
if (!page.has("embed")) view.focus(); // another page's focus is its own

// ---- clocks

let last = clock();

/** Shows the present state, once per picture. */
function show() {
  const now = clock();
  const player = crowd.members.size ? session.player : null; // before, its clock would start by messages that came while the page was made
  if (player) history.note(player.clock.advance(now), crowd.people); // before: tracks never go back
  player?.advance(now);
  const moment = timeline.advance(now - last);
  crowd.play(moment === null ? null : { history, moment });
  overlays.update(crowd.people, (person) => (moment === null ? person.played.track.contacts : history.contacts(person.agent.alias, moment)));
  drive.advance(now, Number(byId("speed").value));
  bar.frame(now, !byId("rest").hidden);
  crowd.showNames(view.clientWidth, view.clientHeight);
  camera.advance(selection.people, now - last);
  session.look(viewpoints(stage.camera.position, selection.people));
  level.reveal(stage.camera.position, stage.controls.target);
  stage.render();
  const fps = readout.frame(now, () => {
    const somebody = crowd.people.some(({ shown }) => shown);
    if (somebody) arrivals.since = Infinity;
    return {
      people: crowd.members.size,
      delay: crowd.members.size ? player.clock.delay(now) : null,
      buffered: player?.buffered ?? Infinity,
      busy: arrivals.busy || crowd.busy(now),
      told: somebody ? "These people walk by themselves." : `${arrivals.nobody}.`,
    };
  });
  if (fps !== null) stage.keepUp(fps);
  if (fps !== null && stage.look === 0 && !page.has("detail")) crowd.refine(stage.camera, DETAILED, now).catch(() => {}); // it stays light
  last = now;
}

setInterval(() => {
  // without an answer it shows "–"; the stream reports whether the connection is lost
  if (!document.hidden) api.stats().then((stats) => readout.stats(stats) ?? session.hurry(), () => readout.stats(null));
}, STATS_SECONDS * 1000);
setInterval(wander, WANDER_SECONDS * 1000);
watchSleep(() => session.wake());

// for the browser's console, and the tests
globalThis.wayfarer = {
  crowd, stage, api, level, book, tools, wardrobe, bones: BONES, timeline, history, drive, overlays, arrivals, selection, frame: show,
  get session() { return session.id; },
  get player() { return session.player; },
  get replay() { return session.watchOnly ? session.current : null; },
  get stream() { return session.current?.stream; },
};
