// How much this page requests of people: all near the camera, less further away (docs/wire-format.md, "Levels of detail"). No DOM.

const SEEN_FAR = [
  "pelvis", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "spine1", "spine2", "spine3",
  "neck", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
];

/** Nobody is left out, since the last ring holds all people. */
export const RINGS = [
  { radius: 15 },
  { radius: 45, format: { encoding: "smallest_three", profile: "bones", bones: SEEN_FAR, fps: 20 } },
  { radius: 20000, format: { encoding: "root" } },
];

const MOST = 8; // maximum viewpoints of a stream

/** The viewpoints: the camera, and the first selected person, shown in full wherever the camera is. */
export function viewpoints({ x, y, z }, selected) {
  const chosen = selected.filter(({ shown }) => shown).slice(0, MOST - 1);
  const places = [{ x, y, z }, ...chosen.map((person) => ({ x: person.x, y: person.y + 1, z: person.z }))];
  return places.map((place) => ({ position: { x: tenth(place.x), y: tenth(place.y), z: tenth(place.z) } }));
}

/** Rounded to a tenth of a metre, so that nothing is sent while hardly anything moves. */
function tenth(metres) {
  return Math.round(10 * metres) / 10;
}
