"""The world's refusals, which change nothing."""

import math

import pytest

from tests.world.fakes import GOAL, make_world, people, populated
from wayfarer.config.limits import Limits
from wayfarer.errors import AlreadyExists, InvalidArgument, NotFound, ResourceExhausted
from wayfarer.world.agents.agent import ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.commands import Path, Stop
from wayfarer.world.stepping.settings import WorldSettings


@pytest.mark.parametrize(
    ("goal", "field", "words"),
    [
        (Goal((math.nan, 0, 0)), "goal.position", r"\(nan, 0, 0\); allowed: at most 10000 m"),
        (Goal((0, math.inf, 0)), "goal.position", r"\(0, inf, 0\)"),
        (Goal((10_001.0, 0, 0)), "goal.position", r"\(10001, 0, 0\); allowed: at most 10000 m"),
        (
            Goal((10_000.0, 0, 0)),
            "goal.position",
            "10000 m from the agent; allowed: at most 1000 m",
        ),
        (Goal((1, 0, 0), radius=0), "goal.radius", "holds 0 m; allowed: 0.05 m to 10 m"),
        (Goal((1, 0, 0), speed=math.nan), "goal.speed", "holds nan m/s; allowed: 0.2 m/s to 4 m/s"),
        (Goal((1, 0, 0), speed=0.1), "goal.speed", "holds 0.1 m/s"),
        (Goal((1, 0, 0), heading=math.inf), "goal.heading", "holds inf; allowed: -100 to 100"),
        (Goal((1, 0, 0), heading=1.0, stop=False), "goal.heading", "strafe on the way"),
        (Goal((1, 0, 0), strafe=True), "goal.strafe", "needs a heading"),
        (Goal((1, 0, 0), dwell=-1.0), "goal.dwell", "holds -1; allowed: 0 to 3600"),
        (Goal((1, 0, 0), stop=False, dwell=1.0), "goal.dwell", "does not stop"),
    ],
)
def test_impossible_goals_are_refused_and_change_nothing(goal, field, words):
    world, [agent] = populated()
    world.give(agent, GOAL, 0.0)
    list(world.advance(1.0))
    with pytest.raises(InvalidArgument, match=words) as error:
        world.give(agent, goal, 1.0)
    assert error.value.field == field
    assert world.get_agent(agent).goal == GOAL
    assert not any(c.flags & ChunkFlag.REPLANNED for c in world.advance(2.0))


@pytest.mark.parametrize(
    ("goals", "field", "words"),
    [
        ([], "goals", "0 goals; allowed: 1 to 4"),
        ([GOAL] * 5, "goals", "5 goals; allowed: 1 to 4"),
        ([GOAL, Goal((1, 0, 0), speed=9.0)], "goals[1].speed", "goals.1..speed holds 9"),
        ([GOAL, Goal((0, 60, 0))], "goals[1].position", "55 m from the goal before it"),
        ([Goal((0, 60, 0))], "goals[0].position", "59 m from the agent"),
        ([GOAL, GOAL, Goal((0, 5, 0), strafe=True)], "goals[2].strafe", "heading"),
    ],
)
def test_impossible_paths_are_refused_and_change_nothing(goals, field, words):
    world, [agent] = populated(limits=Limits(path_goals=4, goal_distance_m=50))
    world.give(agent, Path((GOAL, Goal((1, 5, 0)))), 0.0)
    list(world.advance(1.0))
    with pytest.raises(InvalidArgument, match=words) as error:
        world.give(agent, Path(tuple(goals)), 1.0)
    assert error.value.field == field
    info = world.get_agent(agent)
    assert (info.goal, info.waypoints, info.goal_revision) == (GOAL, 2, 1)
    assert not any(c.flags & ChunkFlag.REPLANNED for c in world.advance(2.0))


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"gender": "robot"}, "agents[1].gender"),
        ({"betas": (0.0,) * 9}, "agents[1].betas"),
        ({"betas": (math.nan,) * 10}, "agents[1].betas"),
        ({"betas": (6.0,) * 10}, "agents[1].betas"),
        ({"position": (math.inf, 0.0)}, "agents[1].position"),
        ({"heading": math.nan}, "agents[1].heading"),
        ({"noise_seed": -1}, "agents[1].noise_seed"),
        ({"name": "x" * 201}, "agents[1].name"),
    ],
)
def test_impossible_agents_are_refused_all_together(values, field):
    world = make_world()
    world.create_session(SessionSpec("s"), 0.0)
    with pytest.raises(InvalidArgument) as error:
        world.create_agents("s", people(1) + people(1, **values), 0.0)
    assert error.value.field == field
    assert world.list_agents("s") == []


def test_what_is_not_there_is_not_found():
    world = make_world()
    for call in (
        lambda: world.get_session("x"),
        lambda: world.delete_session("x"),
        lambda: world.create_agents("x", people(1), 0.0),
        lambda: world.list_agents("x"),
        lambda: world.get_agent("x"),
        lambda: world.delete_agent("x"),
        lambda: world.give("x", GOAL, 0.0),
        lambda: world.give("x", Stop(), 0.0),
    ):
        with pytest.raises(NotFound, match="'x'"):
            call()


def test_limits_are_kept_all_or_none():
    world = make_world(limits=Limits(agents=5, agents_per_session=3, sessions=2))
    world.create_session(SessionSpec("a"), 0.0)
    world.create_session(SessionSpec("b"), 0.0)
    with pytest.raises(ResourceExhausted, match="all 2 sessions"):
        world.create_session(SessionSpec("c"), 0.0)
    with pytest.raises(ResourceExhausted, match="allowed per session: 3"):
        world.create_agents("a", people(4), 0.0)
    world.create_agents("a", people(3), 0.0)
    with pytest.raises(ResourceExhausted, match="3 of 5 agents exist"):
        world.create_agents("b", people(3), 0.0)
    assert len(world.registry.agents) == 3
    world.delete_session("a")
    world.create_agents("b", people(3), 0.0)
    assert (len(world.registry.agents), len(world.registry.sessions)) == (3, 1)


def test_session_ids():
    world = make_world()
    world.create_session(SessionSpec("a.B-c_1"), 0.0)
    with pytest.raises(AlreadyExists):
        world.create_session(SessionSpec("a.B-c_1"), 0.0)
    for bad in ("", "../x", "a b", "-a", "ä", "a\n", "x" * 65):
        with pytest.raises(InvalidArgument, match="1 to 64") as error:
            world.create_session(SessionSpec(bad), 0.0)
        assert error.value.field == "session_id"
    made = {world.create_session(SessionSpec(), 0.0).session_id for _ in range(2)}
    assert len(made) == 2


def test_settings_are_checked():
    with pytest.raises(InvalidArgument, match="phases is 3; allowed"):
        WorldSettings(phases=3)
    with pytest.raises(InvalidArgument, match="lead"):
        WorldSettings(lead=0)
    with pytest.raises(InvalidArgument, match="ascending"):
        WorldSettings(batch_sizes=(4, 2))
    with pytest.raises(ValueError, match="sessions"):
        Limits(sessions=0)
