// Decisions that need no screen: which people to create, and where to send them. No DOM; chance is an argument.

const NAMES = [
  "Ada", "Bo", "Chidi", "Dara", "Elif", "Finn", "Gia", "Hugo", "Ines", "Jun", "Kofi", "Lena", "Mira",
  "Noor", "Omar", "Pia", "Quinn", "Rosa", "Sami", "Tess", "Uma", "Vik", "Wen", "Ximena", "Yara", "Zoe",
];
const HEIGHT = { female: [1.65, 0.07], male: [1.78, 0.075] }; // mean and deviation, metres
const APART = 1.0; // metres between two people at the start
const FARTHEST = 500; // metres, the largest scene

/**
 * `count` agents of random gender and shape on free places around `middle` (glTF basis). `heights[gender]` is the body's
 * [minimum, maximum], and `taken` has places { x, z }. `heightAt(x, z)` returns the ground's height, or null without ground.
 */
export function randomAgents(count, heights, taken, { middle, heightAt = () => 0, random = Math.random } = {}) {
  const places = taken.map(({ x, z }) => ({ x, z }));
  const agents = [];
  for (let k = 0; k < count; k += 1) {
    const gender = random() < 0.5 ? "female" : "male";
    const [mean, deviation] = HEIGHT[gender];
    const [least, most] = heights[gender];
    const drawn = mean + deviation * normal(random);
    const place = freePlace(places, { middle, heightAt, random });
    places.push(place);
    agents.push({
      gender,
      phenotype: {
        height_m: Math.min(most, Math.max(least, drawn)),
        weight: clamp(0.5 + 0.18 * normal(random)),
        muscle: clamp(0.5 + 0.18 * normal(random)),
        age: 20 + 45 * random(), // years
      },
      position: { x: place.x, y: heightAt(place.x, place.z) ?? 0, z: place.z },
      heading: (random() * 2 - 1) * Math.PI,
      name: NAMES[Math.floor(random() * NAMES.length)],
    });
  }
  return agents;
}

/** A place at least `APART` from the others, as near to `middle` as chance allows. */
export function freePlace(taken, { middle = { x: 0, z: 0 }, heightAt = () => 0, random = Math.random } = {}) {
  for (let radius = 1.5; ; radius *= 1.08) {
    const angle = random() * 2 * Math.PI;
    const distance = radius * Math.sqrt(random());
    const place = { x: middle.x + distance * Math.cos(angle), z: middle.z + distance * Math.sin(angle) };
    const apart = taken.every(({ x, z }) => Math.hypot(x - place.x, z - place.z) >= APART);
    // without any ground, the server finds a place
    if (apart && (heightAt(place.x, place.z) !== null || radius > FARTHEST)) return place;
  }
}

/** Places for `count` people around a point, 0.9 m apart (sunflower pattern), the first on it. */
export function formation(point, count) {
  const golden = Math.PI * (3 - Math.sqrt(5));
  return Array.from({ length: count }, (_, k) => ({
    x: point.x + 0.9 * Math.sqrt(k) * Math.cos(k * golden),
    z: point.z + 0.9 * Math.sqrt(k) * Math.sin(k * golden),
  }));
}

const ROW = 3; // people side by side in rows
const STRIDE = 0.9; // metres between two people

/**
 * Where each of `people` { x, z } goes around a point. Shapes: "cluster"; "line" across the way; "rows" along it; "kept", their
 * present formation. In lines and rows nobody has to cross another's way.
 */
export function arranged(point, people, shape) {
  const mean = (axis) => people.reduce((sum, person) => sum + person[axis], 0) / people.length;
  const middle = { x: mean("x"), z: mean("z") };
  if (shape === "kept") return people.map(({ x, z }) => ({ x: point.x + x - middle.x, z: point.z + z - middle.z }));
  if (shape === "cluster") return formation(point, people.length);
  const heading = dragHeading(middle, point) ?? 0;
  const on = { x: Math.sin(heading), z: Math.cos(heading) }, aside = { x: on.z, z: -on.x };
  const share = (axis) => ({ x, z }) => x * axis.x + z * axis.z;
  const by = (value) => (a, b) => value(people[a]) - value(people[b]);
  const places = [];
  const wide = shape === "line" ? people.length : ROW;
  const order = people.map((_, k) => k).sort((a, b) => by(share(on))(b, a)); // people in front stay in front
  for (let first = 0; first < order.length; first += wide) {
    const row = order.slice(first, first + wide).sort(by(share(aside)));
    row.forEach((k, column) => {
      const right = STRIDE * (column - (row.length - 1) / 2), back = (STRIDE * first) / wide;
      places[k] = { x: point.x + right * aside.x - back * on.x, z: point.z + right * aside.z - back * on.z };
    });
  }
  return places;
}

/** The people that a click sends. `people` are { x, z }, `mode` is "selected", "nearest" or "all", `selected` is a list. */
export function recipients(mode, people, selected, point) {
  const byDistance = [...people].sort((a, b) => distance(a, point) - distance(b, point));
  if (mode === "all") return byDistance;
  if (mode === "selected") return byDistance.filter((person) => selected.includes(person));
  return mode === "nearest" ? byDistance.slice(0, 1) : [];
}

/** Where follower number `k` walks, relative to its leader: rows of five. */
export function escort(k) {
  return { behind: Math.min(10, 1.2 + 0.9 * Math.floor(k / 5)), right: 0.8 * [0, 1, -1, 2, -2][k % 5] };
}

/** The people who do something about `other`, without `other`; arguments as in `recipients`. */
export function othersThan(other, mode, people, selected) {
  const rest = people.filter((person) => person !== other);
  return recipients(mode, rest, selected, other);
}

/** Heading of a drag over the floor (0: +Z, positive towards +X), or null if it is too short. */
export function dragHeading(from, to) {
  return distance(from, to) < 0.25 ? null : Math.atan2(to.x - from.x, to.z - from.z);
}

/** The person whose upright axis (from `y`, `height` high) a ray passes nearest, within 0.35 m. */
export function pick(people, ray) {
  let best = null;
  let nearest = 0.35;
  for (const person of people) {
    const gap = axisGap(ray.origin, ray.direction, person);
    if (gap < nearest) [best, nearest] = [person, gap];
  }
  return best;
}

/** The text for an event, or "" if the picture shows it; `name` is the agent's. */
export function eventText({ kind, waypoint, detail }, name, goals) {
  const place = goals > 1 ? `goal ${waypoint + 1}` : "the goal";
  return {
    goal_reached: `${name} has reached ${place}`,
    path_done: "",
    gap: `some motion was skipped: ${isLocal() ? "this computer is busy" : "the connection is slow"}`,
    draining: "the server is about to stop",
    unreachable: `${name} waits: no way leads to ${place}`,
    blocked: `${name} waits: the way to ${place} is closed`,
    goal_moved: `${name} goes as near to ${place} as there is room`,
    behaviour_ended: `${name} stands: ${detail || "whom it looked to has gone"}`,
    model_changed: name ? `${name}: ${detail || "another motion model"}` : detail,
  }[kind] ?? detail;
}

function axisGap(origin, direction, { x, y: floor = 0, z, height }) {
  // the ray's point nearest to the vertical line through (x, z); then clamp the line to the body
  const across = direction.x ** 2 + direction.z ** 2;
  if (across < 1e-9) return Math.hypot(origin.x - x, origin.z - z);
  const along = ((x - origin.x) * direction.x + (z - origin.z) * direction.z) / across;
  if (along < 0) return Infinity;
  const y = origin.y + along * direction.y - floor;
  const above = Math.max(0, y - height, -y);
  const side = Math.hypot(origin.x + along * direction.x - x, origin.z + along * direction.z - z);
  return Math.hypot(side, above);
}

function distance(a, b) {
  return Math.hypot(a.x - b.x, a.z - b.z);
}

function clamp(share) {
  return Math.min(1, Math.max(0, share));
}

/** Box-Muller; 1 - random() keeps the logarithm finite. */
function normal(random) {
  return Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random());
}

/** The text when fewer people have come than were requested. */
export function comeText(came, count) {
  return `${came} of ${count} people came; ${isLocal() ? "this computer" : "the server"} is busy`;
}

/** Whether the server is on the visitor's own machine. */
function isLocal() {
  return /^(localhost|127\.|\[::1\])/.test(globalThis.location?.hostname ?? "localhost");
}

/** A sentence about the people that come, made from the answer of `Api.populate`. */
export function crowdText({ came, waiting, reason }) {
  if (!came && !waiting) return "they leave";
  if (!waiting) return came === 1 ? "1 person is here" : `${came} people are here`;
  return reason ? comeText(came, came + waiting) : `${came} of ${came + waiting} people are here; the rest are on their way`;
}
