"""Worlds whose sessions continue in another world."""

from dataclasses import replace

import pytest

from tests.runtime.kept_worlds import STICK, fake_worlds
from tests.world.scenes.grounds import DOOR, field
from wayfarer.config.limits import Limits
from wayfarer.errors import (
    InvalidArgument,
)
from wayfarer.runtime.persistence.capture import capture_planned, capture_session
from wayfarer.runtime.persistence.session_record import decode_record, encode_record
from wayfarer.runtime.persistence.snapshot import decode_session
from wayfarer.runtime.streams.publisher import SessionLog
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Patrol, Routine, Stand, Wander
from wayfarer.world.behaviours.routine import Part
from wayfarer.world.goals.commands import Path
from wayfarer.world.scenes.messages import Crowd, SceneSource
from wayfarer.world.scenes.populate import CrowdPeople

NOTHING = SessionLog("e", 0, 0.0, None, {}, ())


def goals(*places):
    return tuple(Goal((float(x), float(y), 0.0)) for x, y in places)


COMMANDS = (
    Path(goals((3, 0), (3, 3), (0, 3), (0, 0), (5, 5))),
    Patrol(goals((2, 0), (0, 2))),
    Wander((0.0, 0.0), 3.0),
    Routine((Part(Patrol(goals((2, 0), (0, 2))), 1.3), Part(Stand(), 0.7)), repeat=True),
)


def walking(now):
    """A world with four walking people, one of whom has just received another goal."""
    world = fake_worlds(lead=1, phases=2).live()
    world.create_session(SessionSpec(session_id="s"), 0.0)
    specs = [AgentSpec(noise_seed=7 + i, position=(i, 0)) for i in range(4)]
    people = world.create_agents("s", specs, 0.0)
    sent = []
    for person, command in zip(people, COMMANDS, strict=True):
        world.give(person.agent_id, command, 0.0)
    sent += world.advance(now)
    world.give(people[0].agent_id, goals((-4, 0))[0], now)
    return world, sent


def at_a_door(now):
    """A world with eight people who have met at a door, and its makers."""
    worlds = fake_worlds(lead=1, phases=2)
    scene = worlds.scenes.create(SceneSource(field(*DOOR).spec)).scene_id
    world = worlds.live()
    world.create_session(SessionSpec("s", scene=scene), 0.0)
    places = [(4.5 + k, y) for y in (4.2, 7.8) for k in range(4)]
    specs = [AgentSpec(noise_seed=k, position=place) for k, place in enumerate(places)]
    for person, (x, y) in zip(world.create_agents("s", specs, 0.0), places, strict=True):
        world.give(person.agent_id, goals((x, 12 - y))[0], 0.0)
    return worlds, world, list(world.advance(now))


def move(world, now, arrives=None, worlds=None):
    """The world in which the session continues, and the chunks sent at once."""
    session = world.registry.session("s")
    assert world.members.freeze(session, True)
    rest = [chunk for due in world.take_rest("s") for chunk in due.chunks]
    assert world.next_event() is None, "nothing is planned for it any more"
    assert not world.skip(now + 60).any(), "nothing of it is late meanwhile"
    taken = capture_planned(world, "s")._replace(log=NOTHING)
    session = decode_record(encode_record(taken, STICK), STICK, Limits())
    there = (worlds or fake_worlds(lead=1, phases=2)).live()
    made = there.members.put_session(session.record, arrives or now, live=session.rows)
    there.members.freeze(made, False)
    return there, rest


def test_who_is_moved_walks_on_bit_for_bit_and_on_time():
    at = 2.113
    assert_moved_alike(at, *walking(at), *walking(at), None)


def test_people_who_are_moved_before_a_door_go_on_bit_for_bit():
    at = 3.113
    (_, stayed, before), (worlds, leaves, moved) = at_a_door(at), at_a_door(at)
    assert stayed.slots.planned.memory.waited.max() > 0.3
    assert_moved_alike(at, stayed, before, leaves, moved, worlds)


def assert_moved_alike(at, stayed, before, leaves, moved, worlds):
    """A session that is moved three times, by `worlds`, shows what it shows where it stays."""
    names = [{c.agent_id: i for i, c in enumerate(w.list_agents("s"))} for w in (stayed, leaves)]
    for _ in range(3):  # there, and on, and on
        leaves, rest = move(leaves, at, worlds=worlds)
        moved += rest
        for _ in range(9):
            at += 0.11
            before += stayed.advance(at)
            moved += leaves.advance(at)
    expected = {(names[0][c.agent_id], c.seq): c for c in before}
    found = {(names[1][c.agent_id], c.seq): c for c in moved}
    assert len(found) == len(moved), "nothing is sent twice"
    assert found.keys() >= expected.keys() and len(expected) > 4 * 20
    for key, chunk in expected.items():
        same = found[key]
        assert same.scheduled_at == pytest.approx(chunk.scheduled_at, abs=1e-6)
        for name in ("translation", "rotations", "contacts"):
            assert getattr(same, name).tobytes() == getattr(chunk, name).tobytes(), key
        for name in ("seq", "first_frame", "goal_revision", "state", "waypoint", "flags"):
            assert getattr(same, name) == getattr(chunk, name), (name, key)


def test_who_comes_too_late_is_shown_later_by_whole_primitives():
    world, _ = walking(2.0)
    there, rest = move(world, 2.0, arrives=30.03)
    chunks = list(there.advance(31.0))
    assert 29.9 < min(c.scheduled_at for c in chunks) < 30.13
    phases = {round(c.scheduled_at % 0.2 * 40) % 8 for c in chunks}
    assert phases == {round(c.scheduled_at % 0.2 * 40) % 8 for c in rest}
    there.delete_session("s")
    assert sum(map(sum, there._population.phases.load)) == 0, "phases are counted right"


@pytest.mark.parametrize("epoch", ["", "a" * 41, "abc\n", "x" * 5000 + "\n~.~"])
def test_an_epoch_that_no_server_makes_is_refused(epoch):
    world, _ = walking(0.5)
    log, session = replace(NOTHING, epoch=epoch), world.registry.session("s")
    world.members.freeze(session, True)
    list(world.take_rest("s"))
    taken = capture_planned(world, "s")._replace(log=log)
    with pytest.raises(InvalidArgument, match="epoch"):
        decode_record(encode_record(taken, STICK), STICK, Limits())


@pytest.mark.parametrize("cut", [10, 40, -1])
def test_a_damaged_copy_is_refused_and_no_client_may_import_one(cut):
    world, _ = walking(0.5)
    crowd = CrowdPeople(Crowd(3), 1.0, leaves_at={"a": float("inf")})
    copy = encode_record(capture_session(world, "s")._replace(crowd=crowd), STICK)
    found = decode_record(copy, STICK, Limits())
    assert (found.crowd, found.log, len(found.record.agents)) == (crowd, None, 4)
    with pytest.raises(InvalidArgument, match="crowd"):
        decode_session(copy, STICK, Limits())
    with pytest.raises(InvalidArgument):
        decode_record(copy[:cut], STICK, Limits())
