// The page's record of a session that the server has forgotten, and its return.

const TOGETHER = 64; // people created in one call

/** Describes the people, their goals, the crates, the camera and the selected people. */
export function remember(crowd, book, { camera, controls }, chosen) {
  return {
    view: { eye: camera.position.toArray(), target: controls.target.toArray() },
    crates: new Map(book.obstacles),
    people: crowd.people.filter(({ shown }) => shown).map((person) => ({
      spec: {
        name: person.agent.name,
        gender: person.agent.gender,
        betas: person.agent.betas,
        position: { x: person.x, y: person.y, z: person.z },
        heading: person.heading,
      },
      look: crowd.looks.get(person.agent.id),
      chosen: chosen.includes(person),
      wanders: person.wanders,
      ahead: person.ahead,
    })),
  };
}

/** A sentence about what is restored. */
export function restoreText({ people, crates }) {
  const count = (number, one, many) => (number ? [`${number} ${number === 1 ? one : many}`] : []);
  const what = [...count(people.length, "person", "people"), ...count(crates.size, "crate", "crates")];
  return what.length ? `The server no longer knows this session. ${what.join(" and ")} come back.` : "";
}

/** Restores them in a session and scene that have just been opened. Returns the ids of the selected people. Throws errors of the server. */
export async function bringBack({ people, crates }, { api, session, book, crowd, commands }) {
  await Promise.all([...crates].filter(([name]) => !book.obstacles.has(name)).map(([name, block]) => book.move(name, block)));
  const chosen = [];
  for (let first = 0; first < people.length; first += TOGETHER) {
    const some = people.slice(first, first + TOGETHER);
    const agents = await api.createAgents(session.id, some.map(({ spec }) => spec));
    chosen.push(...agents.filter((_, k) => some[k].chosen).map(({ agent_id: id }) => id));
    await Promise.all(agents.map(({ agent_id: id }, k) => {
      const { look, wanders, ahead } = some[k];
      if (look) crowd.dress(id, look);
      return wanders ? commands.roamAgent(id) : ahead.length > 0 && commands.sendAgent(id, ahead);
    }));
  }
  return chosen;
}
