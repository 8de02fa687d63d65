"""Behaviours on the flat floor with the fake engine: patrols, company, queues, routines."""

import math
from itertools import pairwise

import numpy as np
import pytest

from tests.world.fakes import make_world, populated, taken
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument
from wayfarer.world.agents.agent import AgentState, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import (
    Follow,
    KeepAway,
    Part,
    Patrol,
    Queue,
    Routine,
    Stand,
    Visit,
    Wander,
)
from wayfarer.world.behaviours.patrol import patrolled
from wayfarer.world.events import EventKind
from wayfarer.world.goals.commands import Append

STOPS = tuple(Goal((x, y, 0.0), speed=1.5) for x, y in ((2.0, 0.0), (2.0, 2.0), (0.0, 2.0)))


def place(world, agent_id):
    return np.array(world.get_agent(agent_id).position[:2])


def apart(world, a, b):
    return float(np.linalg.norm(place(world, a) - place(world, b)))


def state(world, agent_id):
    return world.get_agent(agent_id).state


def run(world, until):
    return list(world.advance(until))


@pytest.mark.parametrize(
    ("to_and_fro", "count", "order"),
    [
        (False, 3, [0, 1, 2, 0, 1, 2, 0]),
        (True, 3, [0, 1, 2, 1, 0, 1, 2]),
        (True, 2, [0, 1, 0, 1]),
        (True, 1, [0, 0, 0]),
        (False, 1, [0, 0]),
    ],
)
def test_the_order_of_a_patrol(to_and_fro, count, order):
    assert [patrolled(step, count, to_and_fro) for step in range(len(order))] == order


@pytest.mark.parametrize("to_and_fro", [False, True])
def test_a_patrol_goes_on_and_keeps_its_revision(to_and_fro):
    world, [agent] = populated()
    revision = world.give(agent, Patrol(STOPS, to_and_fro), 0.0)
    seen = {}
    for chunk in world.advance(25.0):
        seen.setdefault(chunk.waypoint, world.get_agent(agent).goal.position)
        assert chunk.goal_revision in (0, revision)
    assert len(seen) > 6
    for waypoint, position in seen.items():
        assert position == STOPS[patrolled(waypoint, 3, to_and_fro)].position


def test_added_goals_end_a_patrol():
    world, [agent] = populated()
    world.give(agent, Patrol(STOPS), 0.0)
    run(world, 3.0)
    world.give(agent, Append((Goal((-3.0, -3.0, 0.0)),)), 3.0)
    run(world, 20.0)
    assert np.allclose(place(world, agent), (-3.0, -3.0), atol=0.35)
    assert state(world, agent) is AgentState.STANDING


@pytest.mark.parametrize("where", [(1.2, 0.0), (0.0, 0.9), (0.0, -0.9)])
def test_a_follower_keeps_its_place_and_stands_when_the_other_stands(where):
    behind, right = where
    world, [leader, follower] = populated(2)
    world.give(follower, Follow(leader, behind=behind, right=right), 0.0)
    world.give(leader, Goal((0.0, 14.0, 0.0)), 0.0)
    run(world, 8.0)
    off = place(world, follower) - place(world, leader)  # it walks along +Y: right is +X
    assert np.allclose(off, (right, -behind), atol=0.45)
    assert state(world, follower) is AgentState.WALKING
    run(world, 20.0)
    assert state(world, leader) is state(world, follower) is AgentState.STANDING
    assert apart(world, leader, follower) == pytest.approx(math.hypot(behind, right), abs=0.5)
    stood = place(world, follower)
    run(world, 24.0)
    assert np.linalg.norm(place(world, follower) - stood) < 0.1


def test_following_is_one_revision_and_ends_with_another_order():
    world, [leader, follower] = populated(2)
    revision = world.give(follower, Follow(leader), 0.0)
    world.give(leader, Goal((0.0, 6.0, 0.0)), 0.0)
    chunks = run(world, 4.0)
    assert {c.goal_revision for c in chunks if c.agent_id == follower and c.seq > 2} == {revision}
    world.give(follower, Append((Goal((6.0, 0.0, 0.0)),)), 4.0)
    run(world, 14.0)
    assert np.allclose(place(world, follower), (6.0, 0.0), atol=0.35)


def test_when_the_other_is_deleted_the_follower_stops_and_it_is_told():
    world, [leader, follower] = populated(2)
    world.give(follower, Follow(leader), 0.0)
    world.give(leader, Goal((0.0, 30.0, 0.0)), 0.0)
    run(world, 5.0)
    world.delete_agent(leader)
    run(world, 9.0)
    [(session, event)] = world.take_events()
    assert (session, event.kind, event.agent_id) == ("s", EventKind.BEHAVIOUR_ENDED, follower)
    assert leader in event.detail
    assert state(world, follower) is AgentState.STANDING


def test_followers_of_followers_walk_in_a_row_and_never_in_a_circle():
    world, names = populated(4)
    for a, b in pairwise(names):
        world.give(b, Follow(a, behind=1.0), 0.0)
    with pytest.raises(InvalidArgument, match="circle"):
        world.give(names[0], Follow(names[3]), 0.0)
    world.give(names[0], Goal((0.0, 20.0, 0.0)), 0.0)
    run(world, 12.0)
    ys = [place(world, name)[1] for name in names]
    assert all(0.5 < a - b < 1.6 for a, b in pairwise(ys))


def test_keeping_away_from_an_agent():
    world, [threat, shy] = populated(2)
    world.give(shy, KeepAway(threat, distance=3.0), 0.0)  # stands at (2, 0), the other at (0, 0)
    run(world, 6.0)
    assert 2.9 < apart(world, threat, shy) < 4.3
    assert state(world, shy) is AgentState.STANDING
    world.give(threat, Goal((9.0, 0.0, 0.0), speed=1.0), 6.0)
    run(world, 15.0)
    assert apart(world, threat, shy) > 2.0
    run(world, 25.0)
    assert apart(world, threat, shy) > 2.9 and state(world, shy) is AgentState.STANDING


def test_keeping_away_from_a_place_and_minding_nothing_far_off():
    world, [near, far] = populated(2)
    for agent in (near, far):
        world.give(agent, KeepAway(place=(0.0, 0.5), distance=1.5), 0.0)
    before = place(world, far)
    run(world, 6.0)
    assert np.linalg.norm(place(world, near) - (0.0, 0.5)) > 1.45
    assert np.linalg.norm(place(world, far) - before) < 0.05


def test_a_queue_lines_up_and_moves_up():
    world, names = populated(4)  # in a row along X
    queue = Queue("till", (0.0, 5.0), heading=0.0, spacing=0.8)
    for name in names:
        world.give(name, queue, 0.0)
    run(world, 15.0)
    line = sorted(names, key=lambda name: -place(world, name)[1])
    for number, name in enumerate(line):
        assert np.allclose(place(world, name), (0.0, 5.0 - 0.9 * number), atol=0.5)
        assert state(world, name) is AgentState.STANDING
        assert abs(world.get_agent(name).heading) < 0.3
    gaps = [place(world, a)[1] - place(world, b)[1] for a, b in pairwise(line)]
    assert all(0.55 < gap < 1.2 for gap in gaps)
    assert line[0] == names[0]  # was the nearest
    world.give(line[0], Goal((5.0, 9.0, 0.0)), 15.0)
    world.delete_agent(line[2])
    run(world, 25.0)
    assert np.allclose(place(world, line[1]), (0.0, 5.0), atol=0.4)
    assert np.allclose(place(world, line[3]), (0.0, 4.1), atol=0.4)


def test_a_routine_goes_through_its_parts():
    world, [agent, other] = populated(2)
    routine = Routine(
        (
            Part(Visit((Goal((0.0, 2.0, 0.0)),))),
            Part(Stand(), seconds=3.0),
            Part(Follow(other, behind=1.0), seconds=4.0),
            Part(Visit((Goal((-3.0, 0.0, 0.0)),))),
        )
    )
    revision = world.give(agent, routine, 0.0)
    world.give(other, Goal((2.0, 12.0, 0.0)), 4.0)
    run(world, 5.0)
    assert np.allclose(place(world, agent), (0.0, 2.0), atol=0.35)
    assert state(world, agent) is AgentState.STANDING
    run(world, 9.5)
    assert place(world, agent)[1] > 3.0  # follows
    run(world, 30.0)
    assert np.allclose(place(world, agent), (-3.0, 0.0), atol=0.4)
    assert state(world, agent) is AgentState.STANDING
    assert world.get_agent(agent).goal_revision == revision


def test_a_routine_begins_again():
    world, [agent] = populated()
    parts = (Part(Visit(STOPS[:1])), Part(Stand(), 1.0), Part(Patrol(STOPS[1:]), 5.0))
    world.give(agent, Routine(parts, repeat=True), 0.0)
    passes = 0
    near = False
    for chunk in world.advance(60.0):
        now = bool(np.linalg.norm(chunk.translation[-1, :2] - STOPS[0].position[:2]) < 0.35)
        passes += now and not near
        near = now
    assert passes >= 4


def test_whom_a_routine_follows_may_be_deleted():
    world, [agent, other] = populated(2)
    parts = (Part(Follow(other), 60.0), Part(Visit((Goal((-4.0, 0.0, 0.0)),))))
    world.give(agent, Routine(parts), 0.0)
    run(world, 1.0)
    world.delete_agent(other)
    run(world, 12.0)
    assert np.allclose(place(world, agent), (-4.0, 0.0), atol=0.35)


@pytest.mark.parametrize("kind", ["follow", "keep_away", "queue", "routine", "patrol"])
def test_a_behaviour_goes_on_in_another_world(kind):
    world, [leader, agent] = populated(2)
    world.give(agent, each_kind(leader)[kind], 0.0)
    world.give(leader, Goal((0.0, 9.0, 0.0)), 0.0)
    run(world, 3.1)
    record = taken(world)
    twin = make_world()
    twin.members.put_session(record, 0.0)
    chunks = run(twin, 12.0)
    assert {c.goal_revision for c in chunks if c.agent_id == agent} == {1}
    if kind == "follow":
        assert apart(twin, leader, agent) < 2.0
    if kind == "queue":
        assert np.allclose(place(twin, agent), (4.0, 4.0), atol=0.4)
    if kind == "keep_away":
        assert apart(twin, leader, agent) > 2.9


def each_kind(other):
    return {
        "follow": Follow(other),
        "keep_away": KeepAway(other, distance=3.0),
        "queue": Queue("q", (4.0, 4.0), 0.0),
        "routine": Routine((Part(Visit(STOPS)), Part(Follow(other))), repeat=False),
        "patrol": Patrol(STOPS),
    }


def test_the_same_calls_give_the_same_motion():
    tracks = []
    for _ in range(2):
        world, names = populated(3)
        world.give(names[1], Follow(names[0], right=1.0), 0.0)
        world.give(names[2], KeepAway(names[1]), 0.0)
        world.give(names[0], Wander((0.0, 5.0), 6.0), 0.0)
        tracks.append([c.translation for c in world.advance(10.0) if c.alias > 1])
    assert all((a == b).all() for a, b in zip(*tracks, strict=True))


@pytest.mark.parametrize("kind", ["follow", "keep_away", "queue", "routine"])
def test_in_a_recorded_session_nobody_depends_on_others(kind):
    world, [a, b] = populated(2, spec=SessionSpec("s", record=True))
    with pytest.raises(FailedPrecondition, match="recorded"):
        world.give(a, each_kind(b)[kind], 0.0)
    world.give(a, Patrol(STOPS), 0.0)


NAN = math.nan


@pytest.mark.parametrize(
    ("behaviour", "field"),
    [
        (Patrol(()), "behaviour.goals"),
        (Patrol((*STOPS, Goal((NAN, 0.0, 0.0)))), "behaviour.goals[3].position"),
        (Patrol(STOPS * 100), "behaviour.goals"),
        (Patrol(tuple(Goal((x, 0.0, 0.0)) for x in (30.0, 60.0, 90.0))), "behaviour.goals[0]"),
        (Follow("nobody"), "behaviour.agent_id"),
        (Follow("no id"), "behaviour.agent_id"),
        (Follow("{self}"), "behaviour.agent_id"),
        (Follow("{other}", behind=NAN), "behaviour.behind"),
        (Follow("{other}", behind=0.1, right=0.1), "behaviour.behind"),
        (Follow("{other}", right=99.0), "behaviour.right"),
        (KeepAway(), "behaviour"),
        (KeepAway("{other}", place=(0.0, 0.0)), "behaviour"),
        (KeepAway(place=(0.0, math.inf)), "behaviour.place"),
        (KeepAway("{other}", distance=1e6), "behaviour.distance"),
        (KeepAway("{other}", speed=0.0), "behaviour.speed"),
        (Queue("", (0.0, 0.0), 0.0), "behaviour.name"),
        (Queue("q", (0.0,), 0.0), "behaviour.head"),
        (Queue("q", (0.0, 0.0), NAN), "behaviour.heading"),
        (Queue("q", (0.0, 0.0), 0.0, spacing=0.0), "behaviour.spacing"),
        (Routine(()), "behaviour.parts"),
        (Routine((Part(Stand()),) * 40), "behaviour.parts"),
        (Routine((Part(Stand()), Part(Stand()))), "behaviour.parts[0].seconds"),
        (Routine((Part(Patrol(STOPS)),), repeat=True), "behaviour.parts[0].seconds"),
        (Routine((Part(Stand(), NAN),)), "behaviour.parts[0].seconds"),
        (Routine((Part(Visit(STOPS)), Part(Follow("nobody")))), "behaviour.parts[1].agent_id"),
        (Routine((Part(Visit(STOPS * 5)), Part(Visit(STOPS * 5)))), "behaviour.parts"),
    ],
)
def test_what_is_refused(behaviour, field):
    world, [agent, other] = populated(2, limits=Limits(path_goals=20, goal_distance_m=40.0))
    if isinstance(behaviour, Follow | KeepAway):
        named = behaviour.agent_id.format(self=agent, other=other)
        values = {name: getattr(behaviour, name) for name in behaviour.__slots__}
        behaviour = type(behaviour)(**{**values, "agent_id": named})
    with pytest.raises(InvalidArgument) as refused:
        world.give(agent, behaviour, 0.0)
    assert refused.value.field.startswith(field)
    assert world.get_agent(agent).goal_revision == 0


def test_all_over_a_floor_without_end_nobody_walks():
    world, [agent] = populated()
    with pytest.raises(FailedPrecondition, match="an area, with center and radius"):
        world.give(agent, Wander(None), 0.0)
