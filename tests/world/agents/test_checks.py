"""What callers may ask for; goals and agents are checked through the world in
test_world_refusals."""

import math

import pytest

from wayfarer.errors import InvalidArgument
from wayfarer.limits import Limits
from wayfarer.world.agents.agent import AgentChange, SessionSpec
from wayfarer.world.agents.checks import check_agent_id, check_change, check_session
from wayfarer.world.agents.goal import Goal, check_path
from wayfarer.world.behaviours import Wander

HERE = (0.0, 0.0, 0.0)
LIMITS = Limits(path_goals=3, goal_distance_m=100.0)


def refusal(call, *args):
    with pytest.raises(InvalidArgument) as error:
        call(*args)
    return error.value.field, str(error.value)


@pytest.mark.parametrize("session_id", ["", "a b", "-a", "ä", "a/b", "x" * 65, "a\n"])
def test_ids_that_are_refused(session_id):
    field, words = refusal(check_session, SessionSpec(session_id))
    assert field == "session_id" and "1 to 64" in words
    field, _ = refusal(check_agent_id, session_id, "agents[3].agent_id")
    assert field == "agents[3].agent_id"


def test_sessions_that_are_allowed():
    for spec in (SessionSpec(), SessionSpec("a.B_c-9"), SessionSpec(seed=2**64 - 1)):
        check_session(spec)
    assert refusal(check_session, SessionSpec(seed=2**64))[0] == "seed"


def test_changes_that_say_nothing_are_allowed():
    check_change(AgentChange())
    check_change(AgentChange(name=""))
    check_change(AgentChange(name="x" * 64, foot_lock=True))
    assert refusal(check_change, AgentChange(name="x" * 65))[0] == "name"


def test_goals_ahead_count_with_those_that_are_added():
    check_path([Goal(HERE)] * 2, HERE, LIMITS, ahead=1)
    field, words = refusal(check_path, [Goal(HERE)] * 2, HERE, LIMITS, 2)
    assert field == "goals" and words == (
        "2 goals are still ahead and 2 were added; allowed: 3 in all"
    )


@pytest.mark.parametrize(
    ("area", "field"),
    [
        (Wander((math.inf, 0.0), 1.0), "area.center"),
        (Wander((0.0, 0.0, 0.0), 1.0), "area.center"),
        (Wander((0.0, 0.0), math.nan), "area.radius"),
        (Wander((0.0, 0.0), 101.0), "area.radius"),
        (Wander((60.0, 0.0), 50.0), "area.center"),
        (Wander((0.0, 0.0), 1.0, speed=math.nan), "area.speed"),
        (Wander((0.0, 0.0), 1.0, dwell=math.inf), "area.dwell"),
    ],
)
def test_areas_that_are_refused(area, field):
    assert refusal(area.check, HERE, LIMITS, "area")[0] == field


def test_an_area_must_not_leave_the_world():
    there = (9990.0, 0.0, 0.0)
    Wander((9990.0, 0.0), 10.0).check(there, LIMITS, "area")
    field, words = refusal(Wander((9995.0, 0.0), 10.0).check, there, LIMITS, "area")
    assert field == "area.center" and "10005 m" in words
