"""Agents and sessions moved from one world to another continue without a difference."""

from dataclasses import replace

import numpy as np
import pytest

from tests.world.fakes import make_world, people, populated, taken, taken_agent
from wayfarer.config.limits import Limits
from wayfarer.errors import AlreadyExists, InvalidArgument, NotFound, ResourceExhausted
from wayfarer.world.agents.agent import ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Wander
from wayfarer.world.goals.commands import Append, Path, Stop
from wayfarer.world.stepping.settings import AdmissionRules

GOAL = Goal((0.0, 9.0, 0.0))
PATH = [Goal((0.0, y, 0.0), stop=False) for y in (1.0, 2.0, 3.0)] + [GOAL]
SPEC = SessionSpec("s", seed=5, attributes={"basis": "ros"})

ORDERS = {
    "stand": lambda w, a, now: None,
    "goal": lambda w, a, now: w.give(a, GOAL, now),
    "path": lambda w, a, now: w.give(a, Path(tuple(PATH)), now),
    "wander": lambda w, a, now: w.give(a, Wander((2.0, 2.0), 3.0), now),
    "clear": lambda w, a, now: (w.give(a, GOAL, now - 0.5), w.give(a, Stop(), now)),
}


def moved(world, now, **settings):
    other = make_world(**settings)
    other.members.put_session(taken(world), now)
    return other


def by_agent(chunks, agent):
    return [c for c in chunks if c.agent_id == agent]


def same(a, b):
    np.testing.assert_array_equal(a.translation, b.translation)
    np.testing.assert_array_equal(a.rotations, b.rotations)
    np.testing.assert_array_equal(a.contacts, b.contacts)
    for name in ("seq", "first_frame", "goal_revision", "state", "waypoint", "alias", "candidates"):
        assert getattr(a, name) == getattr(b, name)


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS)
@pytest.mark.parametrize("settings", [{}, {"lead": 3, "phases": 2}], ids=["alike", "other"])
def test_a_session_goes_on_elsewhere_frame_for_frame(order, settings):
    world, [agent, other] = populated(2, spec=SPEC)
    order(world, agent, 1.0)
    list(world.advance(4.0))
    there = moved(world, 1000.0, **settings)
    assert there.get_session("s") == world.get_session("s")
    for name in (agent, other):
        a, b = world.get_agent(name), there.get_agent(name)
        assert (a.spec, a.state, a.position, a.alias) == (b.spec, b.state, b.position, b.alias)
        assert (a.goal_revision, a.created_at) == (b.goal_revision, b.created_at)
    here, gone = list(world.advance(16.0)), list(there.advance(1012.0))
    for name in (agent, other):
        pairs = list(zip(by_agent(here, name), by_agent(gone, name), strict=False))
        assert len(pairs) > 50
        for a, b in pairs:
            same(a, b)
    first = by_agent(gone, agent)[0]
    assert first.scheduled_at >= 1000.0 and not first.flags & ChunkFlag.FIRST


@pytest.mark.parametrize("asked", np.arange(3.0, 3.2, 0.025).round(3))
def test_an_order_that_has_not_shown_yet_goes_along(asked):
    """Motion that is planned for the earlier path is discarded, but the command is not."""
    world, [agent, _] = populated(2, spec=SPEC)
    world.give(agent, Path(tuple(PATH)), 0.0)
    sent = by_agent(world.advance(asked), agent)
    world.give(agent, Path((Goal((4.0, 2.0, 0.0)), Goal((4.0, 4.0, 0.0)))), asked)
    there = moved(world, 50.0)
    chunks = by_agent(there.advance(70.0), agent)
    assert chunks[0].seq == sent[-1].seq + 1
    assert {c.goal_revision for c in chunks} == {2}
    assert [c.waypoint for c in chunks if c.flags & ChunkFlag.ARRIVED] == [0, 1]
    step = np.linalg.norm(chunks[0].translation[0] - sent[-1].translation[-1])
    assert step < 0.1, "no jump beyond a frame's motion"


def test_a_path_that_is_fed_can_be_moved():
    world, [agent, _] = populated(2, spec=SPEC, limits=Limits(path_goals=4))
    world.give(agent, Path(tuple(PATH[:3])), 0.0)
    list(world.advance(2.5))
    world.give(agent, Append((Goal((0.0, 5.0, 0.0), stop=False), GOAL)), 2.5)
    record = taken_agent(world, agent)
    assert record.passed > 0 and record.passed + len(record.path) == 5
    there = moved(world, 0.0, limits=Limits(path_goals=4))
    there.give(agent, Append((Goal((0.0, 12.0, 0.0)),)), 0.0)
    arrived = [c.waypoint for c in there.advance(30.0) if c.flags & ChunkFlag.ARRIVED]
    assert arrived[-1] == 5 and arrived == list(range(arrived[0], 6))


def test_taking_leaves_everything_as_it_was():
    world, [agent, _] = populated(2, spec=SPEC)
    reference, [same_agent, _] = populated(2, spec=SPEC)
    for w, a in ((world, agent), (reference, same_agent)):
        w.give(a, Wander((0.0, 0.0), 4.0), 0.0)
    found = []
    while (event := world.next_event()) <= 20.0:
        found += by_agent(world.tick(event), agent)
        taken(world)
    for a, b in zip(found, by_agent(reference.advance(20.0), same_agent), strict=True):
        same(a, b)


def test_aliases_and_ids_go_on_where_they_were():
    world, [first, second] = populated(2, spec=SPEC)
    world.delete_agent(second)
    there = moved(world, 5.0)
    [new] = there.create_agents("s", people(1), 5.0)
    assert new.alias == 3, "that of the one who was deleted is not used again"
    with pytest.raises(AlreadyExists, match="session 's'"):
        there.members.put_session(taken(world), 5.0)
    there.create_session(SessionSpec("t"), 5.0)
    with pytest.raises(AlreadyExists, match=first):
        there.members.put_agent("t", taken_agent(world, first), 5.0)


def test_an_agent_can_be_put_into_another_session():
    world, [first, _] = populated(2, spec=SPEC)
    list(world.advance(1.0))
    there = make_world()
    there.create_session(SessionSpec("t"), 0.0)
    info = there.members.put_agent("t", taken_agent(world, first), 0.0)
    assert (info.session_id, info.agent_id) == ("t", first)
    with pytest.raises(NotFound):
        there.members.put_agent("nowhere", taken_agent(world, first), 0.0)
    twin = replace(taken_agent(world, first), agent_id="twin")
    with pytest.raises(AlreadyExists, match="alias 1"):
        there.members.put_agent("t", twin, 0.0)
    [new] = there.create_agents("t", people(1), 0.0)
    assert new.alias == 2


def test_room_and_time_are_asked_for_all_or_nothing():
    world, _ = populated(4, spec=SPEC)
    record = taken(world)
    small = make_world(limits=Limits(agents=3))
    with pytest.raises(ResourceExhausted, match="0 of 3"):
        small.members.put_session(record, 0.0)
    busy = make_world(admission=AdmissionRules(most_load=0.1))
    busy.load.admission.measured(1, 1, 0.1)
    with pytest.raises(ResourceExhausted, match="cannot add 4 agents: 0 of about"):
        busy.members.put_session(record, 0.0)
    for there in (small, busy):
        assert (len(there.registry.sessions), len(there.registry.agents)) == (0, 0)
    assert len(busy.members.put_session(record, 0.0, admit=False).agents) == 4


def change(record, **values):
    agent = replace(record.agents[0], **values)
    return replace(record, agents=(agent, *record.agents[1:]))


def spoil(record, path, value):
    motion = record.agents[0].motion.take(np.array([0]))
    part = motion
    *parents, last = path.split(".")
    for name in parents:
        part = getattr(part, name)
    getattr(part, last)[:] = value
    return change(record, motion=motion)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda r: replace(r, session_id="../x"), "session_id"),
        (lambda r: replace(r, last_alias=1), "alias is 2; allowed: at most last_alias, 1"),
        (lambda r: replace(r, agents=(r.agents[0],) * 2), "same agent_id"),
        (lambda r: change(r, alias=2), "same alias"),
        (lambda r: change(r, model="m" * 300), "300 characters; allowed"),
        (lambda r: change(r, seq=2**60), "allowed: 0 to"),
        (lambda r: change(r, passed=3), "waypoint is 0; allowed: 3 to 3"),
        (lambda r: spoil(r, "seed.rotations", 0.0), "unit quaternions"),
        (lambda r: spoil(r, "gait.mode", 17), "unknown mode"),
    ],
)
def test_records_that_cannot_be_are_refused_and_change_nothing(damage, words):
    """`runtime/persistence/test_snapshot.py` has more, as bytes that a client invents."""
    world, _ = populated(2)
    list(world.advance(1.0))
    there = make_world()
    with pytest.raises(InvalidArgument, match=words):
        there.members.put_session(damage(taken(world)), 0.0)
    assert (len(there.registry.sessions), len(there.registry.agents)) == (0, 0)
