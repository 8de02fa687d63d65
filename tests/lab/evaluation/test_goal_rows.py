"""Judging manoeuvres whose course is known."""

import math

import numpy as np
import pytest

from tests.lab.evaluation.people import course, line
from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation import goal_rows

SECONDS = np.arange(1, 12 * FPS + 1) / FPS
AHEAD = Goal((0.0, 1.5, 0.0))


def test_near_goals_that_are_never_reached_count_as_later_than_all_others() -> None:
    fast, slow = (course(line(np.minimum(v * SECONDS, 1.5)), AHEAD) for v in (1.0, 0.2))
    never = course(line(0.0 * SECONDS), AHEAD)
    row = goal_rows.near_row("near", [fast, slow, never])
    assert row["reached_15"] == pytest.approx(1 / 3), "1.2 m at 1 m/s are 6 primitives"
    assert row["success_03m"] == pytest.approx(2 / 3)
    assert row["steps_median"] == pytest.approx(1.2 / 0.2 / 0.2, abs=1), "that of the slow one"
    assert math.isnan(float(goal_rows.near_row("never", [fast, never, never])["steps_median"]))


def test_speed_is_that_of_the_cruise() -> None:
    start = np.clip(SECONDS, 0, 2).cumsum() / 2 / FPS  # speeds up for 2 s
    way = np.minimum(start, 11.0)
    goal = Goal((0.0, 12.0, 0.0), speed=1.2)
    row = goal_rows.speed_row("1.2 m/s", [course(line(way), goal)])
    assert row["wished_mps"] == 1.2
    assert row["speed_mps"] == pytest.approx(1.0, abs=0.01)
    assert row["speed_error_mps"] == pytest.approx(0.2, abs=0.01)


def test_agents_who_never_cruised_have_no_speed() -> None:
    row = goal_rows.speed_row("near", [course(line(SECONDS), AHEAD)])
    assert math.isnan(float(row["speed_mps"]))


def test_a_turn_is_timed_and_its_drift_measured() -> None:
    heading = np.minimum(SECONDS * np.radians(60), np.radians(85))
    drift = line(0.1 * np.sin(SECONDS))
    goal = Goal((0.0, 0.0, 0.0), heading=np.radians(90))
    row = goal_rows.turn_row("90°", [course(drift, goal, heading)])
    assert row["steps_median"] == pytest.approx(75 / 60 / 0.2, abs=1)
    assert row["faced_15"] == 1.0
    assert row["facing_error_median_deg"] == pytest.approx(5.0, abs=0.01)
    assert row["drift_max_m"] == pytest.approx(0.1, abs=0.01)


def test_one_who_does_not_turn_never_faces_the_heading() -> None:
    goal = Goal((0.0, 0.0, 0.0), heading=np.pi)
    row = goal_rows.turn_row("180°", [course(line(0 * SECONDS), goal)])
    assert row["faced_15"] == 0.0 and math.isnan(float(row["steps_median"]))
    assert row["facing_error_p90_deg"] == pytest.approx(180.0)


def test_a_turn_without_a_heading_is_refused() -> None:
    with pytest.raises(InvalidArgument, match="heading"):
        goal_rows.turn_row("turn", [course(line(SECONDS), AHEAD)])


PATH = [
    Goal((0.0, 4.0, 0.0), stop=False),
    Goal((0.0, 8.0, 0.0), stop=False),
    Goal((0.0, 12.0, 0.0)),
]


def test_waypoints_passed_at_full_speed() -> None:
    row = goal_rows.waypoint_row("straight", [course(line(np.minimum(1.2 * SECONDS, 12)), PATH)])
    assert row["passed"] == 1.0 and row["missed_by_m"] == pytest.approx(0.0, abs=0.02)
    assert row["speed_kept_mean"] == pytest.approx(1.0, abs=0.01)
    assert row["success_03m"] == 1.0


def test_a_stop_at_a_waypoint_and_a_miss_are_seen() -> None:
    pause = np.clip(SECONDS - 4.0 / 1.2, 0, 1.0)  # a second of standing at the first
    stopping = course(line(np.minimum(1.2 * (SECONDS - pause), 12)), PATH)
    row = goal_rows.waypoint_row("stop", [stopping])
    assert row["speed_kept_p10"] < 0.2 < row["speed_kept_mean"] < 0.7
    wide = course(line(1.2 * SECONDS) + np.array([1.0, 0.0]), PATH)
    row = goal_rows.waypoint_row("wide", [wide])
    assert row["passed"] == 0.0 and row["missed_by_m"] == pytest.approx(1.0, abs=0.01)


def test_a_new_goal_behind() -> None:
    turn = np.clip((SECONDS - 3) * np.radians(90), 0, np.pi)  # 2 s from the order, in place
    y = np.where(SECONDS < 3, SECONDS, 3 - np.clip(SECONDS - 5, 0, 4))
    goal = Goal((0.0, -1.0, 0.0))
    row = goal_rows.change_row("behind", [course(line(y), goal, turn, frame=3 * FPS)])
    assert row["steps_headed_median"] == pytest.approx(150 / 90 / 0.2, abs=1)
    assert row["steps_median"] == pytest.approx((2 + 3.25) / 0.2, abs=1)
    assert row["detour"] == pytest.approx(1.0, abs=0.02)
    assert row["success_03m"] == 1.0


def test_strafing_is_judged_on_the_way_only() -> None:
    way = np.minimum(0.5 * SECONDS, 3.0)
    heading = np.where(way < 2.0, 0.2, 2.0)  # turns when it is nearly there
    goal = Goal((-3.0, 0.0, 0.0), heading=0.0, strafe=True)
    row = goal_rows.strafe_row("left", [course(line(way, np.pi / 2), goal, heading)])
    expected = np.degrees([0.2] * (4 * FPS - FPS) + [2.0] * (FPS // 2)).mean()
    assert row["facing_error_mean_deg"] == pytest.approx(expected, rel=0.02)
    assert row["success"] == 1.0 and row["speed_mps"] == pytest.approx(0.5, abs=0.01)
    assert row["steps_median"] == pytest.approx(2.25 / 0.5 * FPS / NEW_FRAMES, abs=1)
