// Puts the page together: session, scene, stage, controls.

import { Access, Api, BONES, clock } from "./client/index.js";
import { Chase } from "./chase.js";
import { crowdText, eventText, randomAgents } from "./choices.js";
import { Crowd } from "./crowd.js";
import { Errands } from "./errands.js";
import { kindOf, watchFiles } from "./files.js";
import { askToken, byId, listPeople, mention, Readout, showConnection, showTrouble, tell } from "./hud.js";
import { ScenePanel } from "./panel.js";
import { floorRing } from "./people.js";
import { watchPointer } from "./pointer.js";
import { NoPicture, Stage } from "./scene.js";
import { PageSession } from "./session.js";
import { Tools } from "./tools.js";
import { Wardrobe } from "./wardrobe.js";

const DETAILED = 24; // so many people have the fine mesh, where the machine draws well
const FIRST_SCENE = "town_square"; // where nothing else is asked for
const AT_FIRST = 10; // people who walk there when the page opens
const MORE = 8; // and who come with the button
const STATS_SECONDS = 1;
const WANDER_SECONDS = 1;
const TOKEN = "wayfarer.token";

const attempt = (action) => (...given) => (
  Promise.resolve().then(() => action(...given)).catch((error) => tell(error.message))
);
const page = new URLSearchParams(location.search);
const query = Object.fromEntries(["encoding", "fps"].filter((key) => page.has(key)).map((key) => [key, page.get(key)]));
const view = byId("view");

const access = new Access(sessionStorage.getItem(TOKEN) ?? "", async (reason) => {
  const token = await askToken(reason);
  sessionStorage.setItem(TOKEN, token); // typed once, kept for this tab
  return token;
});
const api = new Api("", {
  access,
  pause: (seconds, { message }) => {
    mention(`${message}; trying again in ${Math.ceil(seconds)} s`);
    return new Promise((done) => setTimeout(done, 1000 * seconds));
  },
});
const stage = new Stage(view);
const readout = new Readout();
const place = new ScenePanel(api, stage, { enter, changed: attempt(() => errands.replan()), attempt });
const { level, book } = place;
const crowd = new Crowd(stage, (x, z, y) => level.heightAt(x, z, y), mesh, refresh, tell);
const session = new PageSession(api, crowd, query, clock, { event: onEvent, ended: () => setTimeout(start, 1000) });
const errands = new Errands(api, crowd, {
  ask: () => ({ mode: sendMode(), selected, speed: Number(byId("speed").value) }),
  heightAt: (x, z, y) => level.heightAt(x, z, y),
  scene: () => session.scene,
});
const tools = new Tools({ stage, level, book, crowd, errands, select, attempt });
const wardrobe = new Wardrobe(api, crowd, { enlist, walk: attempt(setOff), attempt });
const chase = new Chase();
const cursor = floorRing(0.1, 0.14, "#b02a37");
cursor.visible = false;
stage.add(cursor);

let bodies = new Map(); // gender → body
let selected = null;
let joining = page.get("session"); // somebody's session to show; one of this page's own after that
start();

async function start() {
  let welcomed = null;
  try {
    const listed = place.begun ? null : place.list();
    const [{ limits }, all] = await Promise.all([api.info(), api.bodies(), listed]);
    bodies = new Map(all.map((body) => [body.gender, body]));
    byId("count").max = Math.min(200, limits.agents_per_session);
    byId("count").oninput({ target: byId("count") }); // what it stands for may be less now
    const watched = joining && await othersSession(joining);
    if (watched) await place.attend(watched.scene);
    else await place.begin(place.value ?? page.get("scene") ?? FIRST_SCENE);
    showTrouble(null);
    welcomed = !watched && !place.begun && !page.has("scene") ? welcome() : null; // is asked for before the stage is made
    place.begun = true;
    await new Promise((go) => setTimeout(go)); // what was asked is sent
    beginStage();
    await welcomed;
  } catch (error) {
    if (error instanceof NoPicture) {
      await welcomed;
      showNoPicture();
      return;
    }
    beginStage();
    showConnection("lost", `${error.message}; trying again`);
    showTrouble("The server does not answer", "Start it with “wayfarer serve”. This page tries again every two seconds.");
    setTimeout(start, 2000);
  }
}

function beginStage() {
  stage.begin(show, page.has("look") ? Number(page.get("look")) : null);
}

function showNoPicture() {
  session.leave();
  showConnection("lost", "not connected");
  showTrouble(
    "This browser shows no 3D",
    "WebGL 2 is off or missing. Switch on hardware acceleration in the browser's settings, or open the page in another browser.",
  );
}

/** People who walk about when the page opens, before the camera. */
async function welcome() {
  stage.approach();
  const { x, z } = stage.controls.target;
  await roamers(AT_FIRST, { x, z });
}

/** People who come and walk about: all over the scene, or `near` a place. */
async function roamers(count, near) {
  await Promise.all((await create(count)).map((id) => errands.roamAgent(id, near)));
}

/** The session that the page's address names, if it can be shown; then it is joined. */
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

/** Begin a session in a scene, or with "" in none. */
async function enter(scene) {
  if (errands.wandering) toggleWander();
  tools.use("send");
  if (joining) session.join(joining, scene);
  else await session.open(scene);
  joining = null;
}

function onEvent(event) {
  const person = crowd.members.get(event.alias);
  if (event.kind === "goal_moved" && person?.wanders) return; // it chose the place itself
  const goals = person ? person.passed + person.ahead.length : 0;
  if (event.kind === "goal_reached" && (person?.wanders || !goals)) return; // on and on
  const text = eventText(event, person?.agent.name || "somebody", goals);
  if (text) mention(text);
}

function mesh(agent, detail) {
  const url = new URL(bodies.get(agent.gender).glb_path, location.href);
  url.searchParams.set("betas", agent.betas.map((beta) => beta.toFixed(4)).join(","));
  url.searchParams.set("style", agent.alias);
  url.searchParams.set("detail", page.get("detail") ?? detail);
  return [url.href, access.headers];
}

function refresh() {
  errands.notice();
  if (selected && crowd.members.get(selected.agent.alias) !== selected) select(null);
  else listPeople(crowd.people, selected);
}

function select(person) {
  selected = person;
  chase.reset();
  stage.controls.enabled = true; // a camera that walked behind somebody is the user's again
  const mode = sendMode();
  if (person && mode === "nearest") setSendMode("selected");
  if (!person && mode === "selected") setSendMode("nearest");
  for (const other of crowd.people) other.marker.visible = other === person;
  refresh();
}

function sendMode() {
  return document.querySelector("input[name=send]:checked").value;
}

function setSendMode(mode) {
  document.querySelector(`input[name=send][value=${mode}]`).checked = true;
}

// ---- what the user asks for; every refusal is shown

const add = attempt((count) => create(count));

/** Create people on free places near what is looked at; `how`: what all of them have. Their ids. */
async function create(count, how = {}) {
  await place.settled;
  if (!session.id) throw new Error("not connected yet");
  const heights = Object.fromEntries(
    [...bodies].map(([gender, body]) => [gender, [body.min_height_m, body.max_height_m]]),
  );
  const where = level.ground
    ? { middle: stage.controls.target, heightAt: (x, z) => level.ground.heightAt(x, z, stage.controls.target.y) }
    : {};
  const people = randomAgents(count, heights, crowd.people, where).map((person) => ({ ...person, ...how }));
  if ("betas" in how) for (const person of people) delete person.phenotype;
  return (await api.createAgents(session.id, people)).map(({ agent_id: id }) => id);
}

/** An agent of a shape { gender, betas } or { phenotype }, with a name; its id. */
async function enlist(shape) {
  const [id] = await create(1, shape);
  return id;
}

/** Let somebody who has just been created walk about, with the camera behind. */
async function setOff(id) {
  const current = session.id;
  for (let person = null; !person && session.id === current;) {
    person = crowd.people.find(({ agent, shown }) => agent.id === id && shown);
    if (!person) {
      await new Promise((go) => setTimeout(go, 50));
      continue;
    }
    select(person);
    follow(true);
    await errands.roam([person]);
  }
}

const remove = attempt(async () => {
  if (tools.name === "crate" && tools.deleteChosen()) return;
  if (selected) await api.deleteAgent(selected.agent.id);
});

const stop = attempt(async () => {
  if (!selected && errands.wandering) toggleWander();
  await errands.stop(selected ? [selected] : crowd.people);
});

const populate = attempt(async () => {
  mention(crowdText(await api.populate(session.id, Number(byId("count").value))));
});

const wander = attempt(() => errands.wander());
const endWandering = attempt(() => errands.endWandering());

function toggleWander() {
  errands.wandering = !errands.wandering;
  byId("wander").setAttribute("aria-pressed", String(errands.wandering));
  if (errands.wandering) wander();
  else endWandering();
}

function follow(on) {
  byId("follow").checked = on;
  chase.reset();
  stage.controls.enabled = true;
}

// ---- controls

byId("more-people").onclick = attempt(() => roamers(MORE));
byId("more").onclick = () => disclose(byId("rest").hidden);
byId("add-one").onclick = () => add(1);
byId("add-many").onclick = () => add(16);
byId("remove").onclick = remove;
watchFiles([byId("character-file"), byId("level-file")], attempt(async (file) => {
  await (await kindOf(file) === "character" ? wardrobe : place).take(file);
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
byId("follow").onchange = ({ target }) => follow(target.checked);
byId("trails").onchange = ({ target }) => crowd.mark("trails", target.checked);
byId("labels").onchange = ({ target }) => crowd.mark("labels", target.checked);
byId("selected").onchange = ({ target }) => {
  select(crowd.members.get(Number(target.value)) ?? null);
};
watchPointer(view, stage.controls, {
  press: (event) => tools.press(event),
  click: (event) => tools.click(event),
});

const ARROWS = { ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
view.addEventListener("keydown", (event) => {
  if (event.key in ARROWS) {
    const { x, y, z } = cursor.position;
    const [dx, dz] = ARROWS[event.key];
    cursor.visible = true;
    cursor.position.set(x + 0.25 * dx, level.heightAt(x + 0.25 * dx, z + 0.25 * dz, y) + 0.014, z + 0.25 * dz);
    event.preventDefault();
  } else if (event.key === "Enter") {
    if (tools.name === "patrol" && tools.points.length > 1) tools.use("patrol");
    else if (cursor.visible) tools.act({ x: cursor.position.x, y: cursor.position.y, z: cursor.position.z });
  }
});

/** One thing at a time: the tool, the camera, the selection. */
function escape() {
  if (tools.name !== "send") tools.use("send");
  else if (byId("follow").checked) follow(false);
  else select(null);
}

const press = (id) => () => byId(id).click();
const KEYS = {
  a: press("add-one"), s: press("add-many"), delete: remove, w: press("wander"), x: press("stop"),
  f: press("follow"), t: press("trails"), l: press("labels"), p: press("populate"), escape,
  g: () => tools.use("send"), c: () => tools.use("crate"),
};
addEventListener("keydown", (event) => {
  // letters act on the stage only: elsewhere they are the user's
  const meant = event.target === view || (event.key.length > 1 && !event.target.matches?.("select, input"));
  if (meant && !event.ctrlKey && !event.metaKey && !event.altKey) KEYS[event.key.toLowerCase()]?.();
});

/** Show the controls that a first look needs not. */
function disclose(all) {
  for (const part of ["rest", "place", "readout"]) byId(part).hidden = !all;
  byId("more").setAttribute("aria-expanded", String(all));
  byId("more").textContent = all ? "Less" : "More";
  document.body.classList.toggle("all", all);
  tools.hint();
}
disclose(page.has("controls"));
view.focus();

// ---- clocks

let last = clock();

/** Everything as it is now, once per picture. */
function show() {
  const now = clock();
  const { player } = session;
  player?.advance(now);
  crowd.play(now);
  crowd.separateNames(stage.camera, view.clientWidth, view.clientHeight);
  moveCamera(now - last);
  level.reveal(stage.camera.position, stage.controls.target);
  stage.render();
  const fps = readout.frame(now, () => ({
    people: crowd.members.size,
    delay: crowd.members.size ? player.clock.delay(now) : null,
    pressure: crowd.members.size ? crowd.pressure(now) : "–",
    buffered: player?.buffered ?? Infinity,
    holds: player?.underruns ?? 0,
  }));
  if (fps !== null) stage.keepUp(fps);
  if (fps !== null && stage.look === 0 && !page.has("detail")) crowd.refine(stage.camera, DETAILED).catch(() => {}); // it stays light
  last = now;
}

/** Behind the selected person, or with the middle of all. */
function moveCamera(seconds) {
  if (!byId("follow").checked || !crowd.people.length) return;
  if (selected?.shown) {
    stage.controls.enabled = false;
    const { eye, target, share } = chase.advance(selected, seconds, (ray) => level.freeAlong(ray));
    stage.glide(eye, target, share);
    return;
  }
  const mean = (axis) => crowd.people.reduce((sum, person) => sum + person[axis], 0) / crowd.people.length;
  stage.follow({ x: mean("x"), y: mean("y"), z: mean("z") }, seconds);
}

setInterval(() => {
  // no answer shows as "–"; whether the connection is lost is the stream's to say
  if (!document.hidden) api.stats().then((stats) => readout.stats(stats), () => readout.stats(null));
}, STATS_SECONDS * 1000);
setInterval(wander, WANDER_SECONDS * 1000);

// for the browser's console, and the tests
globalThis.wayfarer = {
  crowd, stage, api, level, book, tools, wardrobe, bones: BONES,
  get session() { return session.id; },
  get player() { return session.player; },
  get stream() { return session.current?.stream; },
};
