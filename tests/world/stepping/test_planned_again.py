"""A step that is discarded before it is sent is planned again alike."""

import numpy as np

from tests.world.scenes.grounds import DOOR, enter, field, world_in
from tests.world.scenes.test_world_scenes import goal


def at_a_door():
    """A world with six people who meet at a door, and their numbers by id."""
    world, _, _ = world_in(field(*DOOR), lead=1, phases=1)
    places = [(4.5 + k, y) for y in (4.2, 7.8) for k in range(3)]
    people = enter(world, *places, gender="female")
    for agent, (x, y) in zip(people, places, strict=True):
        world.give(agent.agent_id, goal(x, 12.0 - y), 0.0)
    return world, {agent.agent_id: number for number, agent in enumerate(people)}


def test_people_at_a_door_who_are_planned_again_do_the_same():
    """Their ways are known: ways that were found for discarded steps are kept."""
    (stays, names), (again, others) = at_a_door(), at_a_door()
    expected, found, waited = {}, {}, 0.0
    for chunk in stays.advance(10.0):
        expected[names[chunk.agent_id], chunk.seq] = chunk.translation.tobytes()
    for turn in range(17):
        for chunk in again.advance(2.0 + 0.5 * turn):
            found[others[chunk.agent_id], chunk.seq] = chunk.translation.tobytes()
        waited = max(waited, float(again.slots.planned.memory.waited.max()))
        for slot in np.flatnonzero(again.slots.active).tolist():
            again._playback.replan(slot, keep_until=0.0)
    assert waited > 1.0
    assert found.keys() == expected.keys() and len(found) > 6 * 40
    assert [key for key in sorted(found) if found[key] != expected[key]] == []
