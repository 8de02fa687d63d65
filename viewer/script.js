// The contents of a share link: a scene, its crates, people with their seeds and goals, and the duration. No DOM.

const VERSION = 1;
const SECONDS = 30; // duration of a shared script
const MOST = 100; // maximum number of people in a link

/**
 * A script of the present state. `agents` come from the server (with seeds), `people` from the stage. `scene` is the name of an
 * example scene, or "". Throws if it cannot be shared.
 */
export function scriptOf({ scene, crates, agents, people, camera }) {
  if (people.length > MOST) throw new Error(`A link holds ${MOST} people at most; there are ${people.length}`);
  const seeds = new Map(agents.map(({ agent_id: id, seed }) => [id, seed]));
  return {
    version: VERSION,
    scene,
    seconds: SECONDS,
    crates: [...crates].map(([name, { top, bottom }]) => [name, rounded(top), round(bottom)]),
    people: people.filter(({ agent, shown }) => shown && seeds.has(agent.id)).map((person) => ({
      name: person.agent.name,
      gender: person.agent.gender,
      betas: [...person.agent.betas].map(round),
      seed: seeds.get(person.agent.id),
      place: [person.x, person.y, person.z].map(round),
      heading: round(person.heading),
      goals: person.wanders ? "roam" : rounded(person.ahead),
    })),
    camera: { eye: camera.eye.map(round), target: camera.target.map(round) },
  };
}

/** The script as text for an address: letters, digits, - and _. */
export async function encodeScript(script) {
  return pack(new TextEncoder().encode(JSON.stringify(script)));
}

/** The script in a text. Throws a readable error if it holds none. */
export async function decodeScript(text) {
  try {
    const script = JSON.parse(new TextDecoder().decode(await unpack(text)));
    if (script.version === VERSION && Array.isArray(script.people) && script.people.length <= MOST) return script;
  } catch {
    // reported below
  }
  throw new Error("The link is not whole, or of another version of this page");
}

/** Bytes as text for an address. */
export async function pack(bytes) {
  let text = "";
  for (const byte of await through(new CompressionStream("deflate-raw"), bytes)) text += String.fromCharCode(byte);
  return btoa(text).replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "");
}

/** The bytes of a text. Throws if it holds none. */
export async function unpack(text) {
  const packed = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (letter) => letter.charCodeAt(0));
  return through(new DecompressionStream("deflate-raw"), packed);
}

async function through(stream, bytes) {
  return new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());
}

const round = (value) => Math.round(value * 1e4) / 1e4;

/** Numbers in a structure, to a tenth of a millimetre. */
function rounded(value) {
  if (typeof value === "number") return round(value);
  if (Array.isArray(value)) return value.map(rounded);
  if (value && typeof value === "object") return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, rounded(inner)]));
  return value;
}
