"""The time until goals show."""

import pytest

from wayfarer_lab.load.reader import GoalWatch
from wayfarer_lab.load.tally import Tally


@pytest.fixture
def tally():
    return Tally()


@pytest.fixture
def goals(tally):
    return GoalWatch(tally)


def slowest(tally):
    return tally.goal_latency.milliseconds()["max"]


def test_latency_runs_from_the_instant_of_the_goal_to_the_first_changed_pose(goals, tally):
    goals.asked(1, 4, 10.0)
    goals.seen(1, 3, 10.1)
    assert tally.goal_latency.count == 0
    goals.seen(1, 4, 10.25)
    goals.seen(1, 4, 10.45)
    assert tally.goal_latency.count == 1
    assert slowest(tally) == pytest.approx(250, rel=2e-3)


def test_a_chunk_that_is_quicker_than_the_reply_counts_too(goals, tally):
    goals.seen(1, 4, 10.05)
    goals.asked(1, 4, 10.0)
    assert slowest(tally) == pytest.approx(50, rel=2e-3)


def test_a_newer_goal_answers_for_those_it_replaced(goals, tally):
    goals.asked(1, 4, 10.0)
    goals.asked(1, 5, 10.1)
    goals.seen(1, 5, 10.3)
    assert tally.goal_latency.count == 2


def test_other_agents_answer_for_nobody(goals, tally):
    goals.asked(1, 4, 10.0)
    goals.seen(2, 4, 10.2)
    assert tally.goal_latency.count == 0


def test_a_goal_that_never_shows_counts_as_late_as_it_is(goals, tally):
    goals.asked(1, 4, 10.0)
    goals.asked(2, 1, 14.5)  # just given: nobody can say yet
    goals.finish(15.0)
    assert tally.unanswered == 1
    assert slowest(tally) == pytest.approx(5000, rel=2e-3)
