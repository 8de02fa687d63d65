// Puts the page together: session, stream, stage, controls.

import { Access } from "./access.js";
import { Api } from "./api.js";
import { dragHeading, eventText, formation, pick, randomAgents, recipients } from "./choices.js";
import { Crowd } from "./crowd.js";
import { Readout, askToken, byId, listPeople, mention, showConnection, tell } from "./hud.js";
import { keepAlive } from "./lease.js";
import { floorRing } from "./people.js";
import { Stage } from "./scene.js";
import { MotionStream } from "./stream.js";

const DETAILED = 24; // so many people get the fine mesh; later ones the light one
const STATS_SECONDS = 1;
const WANDER_SECONDS = 1;
const WANDER_RADIUS = 9; // metres around the middle
const LEASE_SECONDS = 60;
const CLICK_PIXELS = 5; // a pointer that moved more was a drag

const access = new Access(askToken);
const api = new Api("", access);
const stage = new Stage(byId("view"));
const readout = new Readout();
const page = new URLSearchParams(location.search);
const wish = Object.fromEntries(["encoding", "fps"].filter((key) => page.has(key)).map((key) => [key, page.get(key)]));
const clock = () => performance.now() / 1000;
const cursor = floorRing(0.1, 0.14, "#b02a37");
cursor.visible = false;
stage.add(cursor);

let session = null;
let bodies = new Map(); // gender → body
let selected = null;
let wandering = false;
let lastSent = []; // those whose path a further waypoint belongs to
let stream = null;
let stopRenewing = () => {};

const crowd = new Crowd(stage, mesh, refresh, tell);
start();

async function start() {
  try {
    bodies = new Map((await api.bodies()).map((body) => [body.gender, body]));
    await openSession();
  } catch (error) {
    showConnection("lost", `${error.message}; trying again`);
    setTimeout(start, 2000);
  }
}

async function openSession() {
  crowd.clear();
  stopRenewing();
  session = (await api.createSession(LEASE_SECONDS)).session_id;
  stopRenewing = keepAlive(api, session, LEASE_SECONDS);
  stream = new MotionStream((resumeToken) => api.streamAddress(session, wish, resumeToken), {
    ...crowd.handlers(clock),
    header: ({ bones, skeleton }, again, sentAt) => {
      crowd.boneNames = bones.map((bone) => skeleton[bone].name);
      if (!again) return;
      crowd.caughtUpAt = sentAt;
      catchUp();
    },
    event: (event) => {
      const person = crowd.members.get(event.alias)?.person;
      if (person?.wanders && event.kind === "goal_reached") return; // on and on
      const goals = person ? person.passed + person.ahead.length : 0;
      const text = eventText(event, person?.agent.name || "somebody", goals);
      if (text) mention(text);
    },
    refused: async (reason) => {
      await access.renew(access.token, reason);
      stream.open();
    },
    status: (state, detail) => {
      const text = { connecting: "connecting", open: "connected", lost: "connection lost, reconnecting" };
      showConnection(state, detail ? `${text[state]} (${detail})` : text[state]);
    },
    failed: (reason) => tell(`${reason}. Reload the page to begin anew.`),
    ended: (reason) => {
      tell(`The session is no more (${reason}). A new one begins.`);
      setTimeout(start, 1000);
    },
  });
}

/** Who has gone while the connection was lost. */
async function catchUp() {
  try {
    crowd.keepOnly(new Set((await api.agents(session)).map((agent) => agent.agent_id)));
  } catch (error) {
    if (error.status !== 404) tell(error.message); // the stream tells of the session's end
  }
}

addEventListener("pagehide", () => session && api.abandonSession(session));

function mesh(agent) {
  const url = new URL(bodies.get(agent.gender).glb_path, location.href);
  url.searchParams.set("betas", agent.betas.map((beta) => beta.toFixed(4)).join(","));
  url.searchParams.set("style", agent.alias);
  url.searchParams.set("detail", page.get("detail") ?? (crowd.members.size > DETAILED ? "low" : "high"));
  return [url.href, access.headers];
}

function refresh() {
  if (selected && crowd.members.get(selected.agent.alias)?.person !== selected) select(null);
  else listPeople(crowd.people, selected);
}

function select(person) {
  selected = person;
  const mode = sendMode();
  if (person && mode === "nearest") setSendMode("selected");
  if (!person && mode === "selected") setSendMode("nearest");
  for (const other of crowd.people) other.marker.visible = other === person;
  refresh();
}

const sendMode = () => document.querySelector("input[name=send]:checked").value;
const setSendMode = (mode) => {
  document.querySelector(`input[name=send][value=${mode}]`).checked = true;
};

// ---- what the user asks for; every refusal is shown

const attempt = (action) => (...given) => {
  Promise.resolve(action(...given)).catch((error) => tell(error.message));
};

const add = attempt(async (count) => {
  if (!session) throw new Error("not connected yet");
  const heights = Object.fromEntries(
    [...bodies].map(([gender, body]) => [gender, [body.min_height_m, body.max_height_m]]),
  );
  await api.createAgents(session, randomAgents(count, heights, crowd.people));
});

const remove = attempt(async () => {
  if (selected) await api.deleteAgent(selected.agent.id);
});

const stop = attempt(async () => {
  const stopped = selected ? [selected] : crowd.people;
  if (!selected && wandering) toggleWander();
  for (const person of stopped) {
    person.wanders = false;
    person.showPath([]);
  }
  await Promise.all(stopped.map((person) => api.clearGoal(person.agent.id)));
});

/** Send people to a point; with `further`, when they have been where they were sent before. */
const sendTo = attempt(async (point, how = {}, further = false) => {
  const present = lastSent.filter((person) => crowd.people.includes(person));
  const onward = further && present.length > 0;
  lastSent = onward ? present : recipients(sendMode(), crowd.people, selected, point);
  if (!lastSent.length) {
    tell(crowd.people.length ? "Select a person first, or send the nearest or all" : "Add people first", true);
  }
  const places = formation(point, lastSent.length);
  await Promise.all(lastSent.map((person, k) => {
    const goal = { ...places[k], ...how, speed: Number(byId("speed").value) };
    return onward && person.ahead.length ? walkOn(person, goal) : walk(person, goal);
  }));
});

async function walk(person, goal) {
  person.wanders = false;
  person.showPath([goal]);
  person.revision = (await api.setPath(person.agent.id, [goal])).revision;
}

/** One goal more; without a heading to face there it is passed through. */
async function walkOn(person, goal) {
  const further = "heading" in goal ? goal : { ...goal, stop: false };
  person.extendPath([further]);
  await api.appendGoals(person.agent.id, [further]);
}

const wander = attempt(async () => {
  if (!wandering) return;
  const idle = crowd.people.filter((person) => !person.wanders && !person.ahead.length);
  const speed = Number(byId("speed").value);
  for (const person of idle) person.wanders = true;
  await Promise.all(idle.map((person) => api.wander(person.agent.id, { x: 0, z: 0 }, WANDER_RADIUS, { speed })));
});

const stand = attempt(async (people) => {
  for (const person of people) person.wanders = false;
  await Promise.all(people.map((person) => api.clearGoal(person.agent.id)));
});

function toggleWander() {
  wandering = !wandering;
  byId("wander").setAttribute("aria-pressed", String(wandering));
  if (wandering) wander();
  else stand(crowd.people.filter((person) => person.wanders));
}

// ---- controls

byId("add-one").onclick = () => add(1);
byId("add-many").onclick = () => add(16);
byId("remove").onclick = remove;
byId("stop").onclick = stop;
byId("wander").onclick = toggleWander;
byId("speed").oninput = (event) => {
  byId("speed-shown").textContent = `${Number(event.target.value).toFixed(1)} m/s`;
};
byId("trails").onchange = (event) => crowd.mark("trails", event.target.checked);
byId("labels").onchange = (event) => crowd.mark("labels", event.target.checked);
byId("selected").onchange = (event) => {
  select(crowd.members.get(Number(event.target.value))?.person ?? null);
};

let pressed = null;
const view = byId("view");
view.addEventListener("pointerdown", (event) => {
  pressed = { x: event.clientX, y: event.clientY, point: stage.floorPoint(stage.ray(event)) };
  stage.controls.enabled = !event.shiftKey; // with Shift a drag is a heading, not a turn of the camera
}, { capture: true });
view.addEventListener("pointerup", (event) => {
  stage.controls.enabled = true;
  if (!pressed || event.button !== 0) return;
  const ray = stage.ray(event);
  if (event.shiftKey) {
    const end = stage.floorPoint(ray);
    const heading = pressed.point && end && dragHeading(pressed.point, end);
    if (pressed.point) sendTo(pressed.point, heading === null ? {} : { heading }, true);
    return;
  }
  if (Math.hypot(event.clientX - pressed.x, event.clientY - pressed.y) > CLICK_PIXELS) return;
  const person = pick(crowd.people, ray);
  if (person) {
    select(person);
    return;
  }
  const point = stage.floorPoint(ray);
  if (point) sendTo(point);
});

const ARROWS = { ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
view.addEventListener("keydown", (event) => {
  if (event.key in ARROWS) {
    const [x, z] = ARROWS[event.key];
    cursor.visible = true;
    cursor.position.x += 0.25 * x;
    cursor.position.z += 0.25 * z;
    event.preventDefault();
  } else if (event.key === "Enter" && cursor.visible) {
    sendTo(cursor.position);
  }
});

const press = (id) => () => byId(id).click();
const KEYS = {
  a: press("add-one"), s: press("add-many"), delete: press("remove"), w: press("wander"), x: press("stop"),
  f: press("follow"), t: press("trails"), l: press("labels"), escape: () => select(null),
};
addEventListener("keydown", (event) => {
  const typing = event.target instanceof HTMLSelectElement;
  if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey) KEYS[event.key.toLowerCase()]?.();
});

// ---- clocks

let last = clock();
stage.renderer.setAnimationLoop(() => {
  const now = clock();
  const moment = crowd.play(now);
  if (byId("follow").checked) followPeople(now - last);
  stage.render();
  const fps = readout.frame(now, () => ({
    people: crowd.members.size,
    delay: crowd.members.size ? crowd.clock.delay(now) : null,
    pressure: crowd.members.size ? crowd.pressure(now) : "–",
    ...crowd.health(moment),
  }));
  if (fps !== null) stage.keepUp(fps);
  last = now;
});

function followPeople(seconds) {
  const people = selected ? [selected] : crowd.people;
  if (!people.length) return;
  const middle = (axis) => people.reduce((sum, person) => sum + person[axis], 0) / people.length;
  stage.follow(middle("x"), middle("z"), seconds);
}

setInterval(() => {
  // no answer shows as "–"; whether the connection is lost is the stream's to say
  if (!document.hidden) api.stats().then((stats) => readout.stats(stats), () => readout.stats(null));
}, STATS_SECONDS * 1000);
setInterval(wander, WANDER_SECONDS * 1000);

globalThis.wayfarer = { crowd, stage, api, get session() { return session; }, get stream() { return stream; } }; // for the browser's console, and the tests
