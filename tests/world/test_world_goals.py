"""Revisions, extended paths, wandering, changes of agents, and the calls of observers."""

import math
from itertools import pairwise

import numpy as np
import pytest

from tests.world.fakes import make_world, people, populated
from wayfarer.config.limits import Limits
from wayfarer.errors import Aborted, InvalidArgument, NotFound
from wayfarer.world.agents.agent import AgentChange, AgentState, ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import Wander
from wayfarer.world.goals.commands import (
    Append,
    Path,
    Stop,
)
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.budget import DegradationLevel

GOAL = Goal((0.0, 5.0, 0.0))
AREA = Wander((5.0, 5.0), 3.0)
FOUR = Steering(reactions=1).with_search(candidates=4)


class Notes:
    """An observer that records its calls."""

    def __init__(self):
        self.calls, self.chunks = [], []

    def opened(self, session):
        self.calls.append(("opened", session.session_id))

    def closed(self, session):
        self.calls.append(("closed", session.session_id))

    def created(self, session, agents, starts):
        self.calls += [
            ("created", agent.agent_id, start) for agent, start in zip(agents, starts, strict=True)
        ]

    def commanded(self, agent, command, seq):
        self.calls.append((command, seq))

    def changed(self, agent, change, seq):
        self.calls.append((change, seq))

    def deleted(self, agent, seq):
        self.calls.append(("deleted", agent.agent_id, seq))

    def planned(self, agent_ids, seqs, candidates, models):
        self.chunks += [
            (agent, seq, candidates) for agent, seq in zip(agent_ids, seqs.tolist(), strict=True)
        ]

    def fell(self, falls):
        self.calls += falls

    def sent(self, due):
        pass

    def strayed(self, session_id, agent_id):
        pass

    def stood(self, agents):
        self.calls.append(("stood", [agent.agent_id for agent in agents]))


def passing(*ys):
    return [Goal((0.0, y, 0.0), stop=False) for y in ys]


def arrivals(chunks):
    return [c.waypoint for c in chunks if c.flags & ChunkFlag.ARRIVED]


CHANGES = {
    "set_goal": lambda w, a, e: w.give(a, GOAL, 1.0, e),
    "set_path": lambda w, a, e: w.give(a, Path((GOAL,)), 1.0, e),
    "append_goals": lambda w, a, e: w.give(a, Append((GOAL,)), 1.0, e),
    "wander": lambda w, a, e: w.give(a, AREA, 1.0, e),
    "clear_goal": lambda w, a, e: w.give(a, Stop(), 1.0, e),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_change_meant_for_another_revision_is_refused(change):
    world, [agent] = populated()
    assert world.give(agent, GOAL, 0.0, expected=0) == 1
    list(world.advance(1.0))
    before = world.get_agent(agent)
    with pytest.raises(Aborted, match=r"revision 1; .* for revision 0"):
        change(world, agent, 0)
    assert world.get_agent(agent) == before
    assert change(world, agent, 1) == 2
    assert world.get_agent(agent).goal_revision == 2
    with pytest.raises(NotFound):
        change(world, "nobody", 1)


# Paths that are extended


def test_added_goals_keep_what_is_planned_and_go_on_counting():
    world, [agent] = populated()
    world.give(agent, Path(tuple(passing(2.0, 4.0))), 0.0)
    before = list(world.advance(2.0))
    assert world.give(agent, Append((*passing(6.0), Goal((0.0, 8.0, 0.0)))), 2.05) == 2
    info = world.get_agent(agent)
    assert (info.waypoints, info.goal.position[1]) == (4, 2.0 + 2.0 * info.waypoint)
    after = list(world.advance(20.0))
    assert after[0].goal_revision == 1, "what was planned stays"
    assert {c.goal_revision for c in after[1:]} == {2}
    assert not any(c.flags & ChunkFlag.REPLANNED for c in after)
    assert arrivals([*before, *after]) == [0, 1, 2, 3]
    walking = [c for c in [*before, *after] if c.waypoint < 3]
    assert {c.state for c in walking} == {AgentState.WALKING}, "it never stops on the way"
    info = world.get_agent(agent)
    assert math.dist(info.position[:2], (0, 8)) < 0.3
    assert (info.waypoint, info.waypoints) == (3, 4)


def test_a_path_given_in_pieces_is_walked_as_one_given_whole():
    whole, [one] = populated()
    pieces, [other] = populated()
    corners = [(0.0, 2.0), (2.0, 2.0), (2.0, 5.0), (-1.0, 5.0)]
    goals = [Goal((*place, 0.0), stop=False) for place in corners]
    whole.give(one, Path(tuple(goals)), 0.0)
    pieces.give(other, Path(tuple(goals[:1])), 0.0)
    for goal in goals[1:]:
        pieces.give(other, Append((goal,)), 0.0)
    for a, b in zip(whole.advance(12.0), pieces.advance(12.0), strict=True):
        np.testing.assert_array_equal(a.translation, b.translation)
        assert (a.waypoint, a.state, a.flags) == (b.waypoint, b.state, b.flags)


@pytest.mark.parametrize("lead", [1, 3])
def test_a_path_can_be_fed_for_ever(lead):
    """It gets far more goals than a path may have, always three ahead."""
    world, [agent] = populated(limits=Limits(path_goals=3), lead=lead)
    ways = (Goal((0.0, 1.0 + number, 0.0), stop=False) for number in range(40))
    world.give(agent, Path(tuple(next(ways) for _ in range(3))), 0.0)
    chunks, fed = [], 3
    while fed < 40:
        chunks += world.tick(world.next_event())
        info = world.get_agent(agent)
        if info.waypoints - info.waypoint < 3:
            fed += 1
            world.give(agent, Append((next(ways),)), chunks[-1].scheduled_at)
        assert info.goal.position[1] == 1.0 + info.waypoint
    chunks += world.advance(60.0)
    assert arrivals(chunks) == list(range(40))
    assert [c.waypoint for c in chunks] == sorted(c.waypoint for c in chunks)
    revisions = [c.goal_revision for c in chunks]
    assert revisions == sorted(revisions) and revisions[-1] == 38


def test_no_more_goals_lie_ahead_than_a_path_may_have():
    world, [agent] = populated(limits=Limits(path_goals=3, goal_distance_m=20))
    world.give(agent, Path(tuple(passing(2.0, 4.0))), 0.0)
    for goals, words in (
        (passing(6.0, 8.0), "2 goals are still ahead and 2 were added; allowed: 3"),
        ([], "0 goals; allowed: 1 to 3"),
        ([Goal((0.0, 30.0, 0.0))], "26 m from the goal before it"),
        ([Goal((0.0, 5.0, 0.0), speed=9.0)], r"goals\[0\].speed holds 9"),
    ):
        with pytest.raises(InvalidArgument, match=words):
            world.give(agent, Append(tuple(goals)), 0.0)
    assert world.get_agent(agent).goal_revision == 1
    list(world.advance(6.0))  # both are reached: nothing is ahead
    world.give(agent, Append(tuple(passing(6.0, 8.0, 10.0))), 6.0)
    assert arrivals(world.advance(20.0)) == [2, 3, 4]


def test_goals_added_to_none_begin_a_path():
    world, [agent] = populated()
    list(world.advance(1.0))
    assert world.give(agent, Append((GOAL,)), 1.05) == 1
    first = next(iter(world.advance(2.0)))
    assert first.flags & ChunkFlag.REPLANNED and first.waypoint == 0
    list(world.advance(12.0))
    assert math.dist(world.get_agent(agent).position[:2], GOAL.position[:2]) < GOAL.radius
    world.give(agent, Append((Goal((3.0, 5.0, 0.0)),)), 12.0)
    chunks = list(world.advance(25.0))
    assert arrivals(chunks) == [1], "an agent who has been there goes on, too"


# Wandering


def test_wanders_from_place_to_place_until_told_otherwise():
    world, [agent] = populated()
    assert world.give(agent, AREA, 0.0) == 1
    chunks, goals = [], {}
    while not chunks or chunks[-1].scheduled_at < 90.0:
        chunks += world.tick(world.next_event())
        info = world.get_agent(agent)
        goals[info.waypoint] = info.goal
    assert {c.goal_revision for c in chunks} == {1}
    assert arrivals(chunks) == list(range(len(arrivals(chunks)))) and len(goals) > 8
    places = [goals[number].position[:2] for number in sorted(goals)]
    assert sorted(goals) == list(range(len(goals)))
    assert all(math.dist(place, AREA.center) <= AREA.radius for place in places)
    assert all(math.dist(a, b) >= 1.0 for a, b in pairwise(places))
    assert world.give(agent, GOAL, 90.0) == 2
    after = list(world.advance(110.0))
    assert arrivals(after) == [0] and world.get_agent(agent).goal == GOAL
    world.give(agent, AREA, 110.0)
    list(world.advance(111.0))
    assert world.give(agent, Stop(), 111.0) == 4
    list(world.advance(114.0))
    info = world.get_agent(agent)
    assert info.state is AgentState.STANDING and info.waypoints == 0


def test_goals_added_to_wandering_end_it_after_the_present_place():
    world, [agent] = populated()
    world.give(agent, AREA, 0.0)
    list(world.advance(4.0))
    info = world.get_agent(agent)
    world.give(agent, Append((GOAL,)), 4.0)
    assert world.get_agent(agent).waypoints == info.waypoint + 2
    chunks = list(world.advance(40.0))
    assert arrivals(chunks)[-2:] == [info.waypoint, info.waypoint + 1]
    assert world.get_agent(agent).goal == GOAL


@pytest.mark.parametrize(
    ("area", "field", "words"),
    [
        (Wander((math.nan, 0.0), 2.0), "behaviour.center", "allowed: at most 10000 m"),
        (Wander((0.0, 0.0, 0.0), 2.0), "behaviour.center", "x, y on the floor"),
        (Wander((0.0, 0.0), 0.4), "behaviour.radius", "allowed: 0.5 m to 50 m"),
        (Wander((0.0, 0.0), math.inf), "behaviour.radius", "allowed: 0.5 m to 50 m"),
        (
            Wander((45.0, 0.0), 10.0),
            "behaviour.center",
            "55 m from the agent; allowed: at most 50 m",
        ),
        (Wander((0.0, 0.0), 2.0, speed=9.0), "behaviour.speed", "holds 9 m/s"),
        (Wander((0.0, 0.0), 2.0, speed=math.nan), "behaviour.speed", "holds nan"),
        (Wander((0.0, 0.0), 2.0, dwell=-1.0), "behaviour.dwell", "holds -1"),
        (Wander((0.0, 0.0), 2.0, dwell=math.inf), "behaviour.dwell", "holds inf"),
    ],
)
def test_impossible_areas_are_refused(area, field, words):
    world, [agent] = populated(limits=Limits(goal_distance_m=50.0))
    with pytest.raises(InvalidArgument, match=words) as error:
        world.give(agent, area, 0.0)
    assert error.value.field == field
    assert world.get_agent(agent).goal_revision == 0


def test_an_area_must_not_leave_the_world():
    world = make_world()
    world.create_session(SessionSpec("s"), 0.0)
    [agent] = world.create_agents("s", people(1, position=(9990.0, 0.0)), 0.0)
    world.give(agent.agent_id, Wander((9990.0, 0.0), 10.0), 0.0)
    with pytest.raises(InvalidArgument, match="10005 m") as error:
        world.give(agent.agent_id, Wander((9995.0, 0.0), 10.0), 0.0)
    assert error.value.field == "behaviour.center"


# Changes of agents


def test_name_and_foot_lock_can_be_changed():
    world, [agent] = populated()
    list(world.advance(1.0))
    assert world.update_agent(agent, AgentChange(name="A" * 64)).spec.name == "A" * 64
    info = world.update_agent(agent, AgentChange(foot_lock=False))
    assert (info.spec.name, info.spec.foot_lock) == ("A" * 64, False)
    assert world.update_agent(agent, AgentChange()) == info
    with pytest.raises(InvalidArgument, match="64 characters") as error:
        world.update_agent(agent, AgentChange(name="x" * 65, foot_lock=True))
    assert error.value.field == "name" and world.get_agent(agent) == info
    assert world.update_agent(agent, AgentChange(name="")).spec.name == ""
    with pytest.raises(NotFound):
        world.update_agent("nobody", AgentChange(name="x"))


def test_sessions_are_told_as_they_were_opened():
    world = make_world()
    spec = SessionSpec("b", seed=2**64 - 1, record=True, attributes={"basis": "unity"})
    world.create_session(spec, 1.0)
    world.create_session(SessionSpec(), 2.0)
    infos = world.list_sessions()
    assert [info.created_at for info in infos] == [1.0, 2.0]
    assert infos[0] == world.get_session("b") and infos[0].spec == spec
    for seed in (-1, 2**64):
        with pytest.raises(InvalidArgument, match="seed"):
            world.create_session(SessionSpec(seed=seed), 0.0)


# Observers


def test_an_observer_learns_of_every_change_and_of_the_chunk_it_begins_with():
    notes = Notes()
    world = make_world(observer=notes, steering=FOUR)
    world.create_session(SessionSpec("s"), 0.0)
    [agent] = (a.agent_id for a in world.create_agents("s", people(1), 0.0))
    assert notes.calls == [("opened", "s"), ("created", agent, people(1)[0])]
    notes.calls.clear()
    world.give(agent, GOAL, 0.0)
    list(world.advance(2.01))
    sent, planned = 9, 10
    world.give(agent, Path((GOAL,)), 2.05)  # chunk 9 is thrown away
    world.give(agent, Append((GOAL,)), 2.05)
    list(world.advance(2.39))
    world.give(agent, Append((GOAL,)), 2.39)
    world.give(agent, AREA, 2.39)  # the next one would be too late
    world.update_agent(agent, AgentChange(foot_lock=False))
    world.give(agent, Stop(), 2.41)
    world.checkpoint()
    world.delete_session("s")
    assert notes.calls == [
        (GOAL, 0),
        (Path((GOAL,)), sent),
        (Append((GOAL,)), sent),
        (Append((GOAL,)), planned + 1),
        (AREA, planned + 1),
        (AgentChange(foot_lock=False), planned + 1),
        (Stop(), planned + 1),
        ("stood", [agent]),
        ("deleted", agent, planned),
        ("closed", "s"),
    ]
    assert notes.chunks == [(agent, seq, 4) for seq in [*range(planned), 9, 10]]


def test_an_observer_learns_how_many_candidates_were_tried():
    notes = Notes()
    world, _ = populated(observer=notes, steering=FOUR)
    list(world.advance(0.5))
    notes.chunks.clear()
    now = world.next_event()
    for level in (DegradationLevel(2), DegradationLevel(1, hold_idle=True)):
        world.collect(now)
        world.step(now, level)
        now += 0.2
    assert [candidates for _, _, candidates in notes.chunks] == [2, 0]


def test_a_command_that_is_refused_is_not_reported():
    notes = Notes()
    world, [agent] = populated(observer=notes)
    for call in (
        lambda: world.give(agent, GOAL, 0.0, expected=5),
        lambda: world.give(agent, Goal((math.nan, 0, 0)), 0.0),
        lambda: world.update_agent(agent, AgentChange(name="x" * 99)),
    ):
        with pytest.raises((Aborted, InvalidArgument)):
            call()
    assert len(notes.calls) == 2  # the session and the agent
