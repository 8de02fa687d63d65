"""Figures of bodies whose pose is written down."""

import numpy as np
import pytest

from tests.lab.evaluation.maneuvers.bodies import take, time, walker
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.twosided import figures, ranges
from wayfarer_lab.evaluation.twosided.verdicts import Person, verdicts_of

HANGING = {"left_shoulder": (0.0, -75.0, 0.0), "right_shoulder": (0.0, 75.0, 0.0)}


def test_a_statue_stands_outside_of_every_range_of_life() -> None:
    found = figures.standing(take(10.0, **HANGING))
    assert found["still_share"] == 1 and found["hands_cm_s"] == found["sway_cm"] == 0
    people = [Person("stand", str(k), found) for k in range(5)]
    judged = {v.figure: v for v in verdicts_of(people, ranges.load())}
    for figure in (
        "still_share",
        "sway_cm",
        "head_cm_s",
        "hands_cm_s",
        "head_yaw_deg",
    ):
        assert not judged[figure].holds, figure


def test_a_walk_gives_its_numbers() -> None:
    found = figures.walking(walker())
    assert found["speed_mps"] == pytest.approx(1.2, abs=0.01)
    assert found["cadence"] == pytest.approx(120, rel=0.02)
    assert found["bob_cm"] == pytest.approx(3, rel=0.05)
    assert found["knee_swing_deg"] == pytest.approx(60, abs=1.5)
    assert found["wrist_cm"] == pytest.approx(0, abs=0.5), "stiff arms"


def test_arms_that_swing_give_their_range() -> None:
    swing = 20 * np.sin(2 * np.pi * time(8.0))
    made = walker(**HANGING)
    still = figures.upper_body(made)
    assert still["arm_out_deg"] == pytest.approx(15, abs=4)
    assert still["wrist_cm"] == pytest.approx(0, abs=0.5)
    chest = figures.upper_body(take(8.0, spine3=(swing, 0, 0), **HANGING))
    assert chest["wrist_cm"] > 10


def test_a_turntable_has_no_lift_and_all_of_its_turn_on_the_floor() -> None:
    found = figures.turning(take(4.0, heading=90 * np.clip((time(4.0) - 1) / 1.5, 0, 1)))
    assert found["lifts_per_90"] == 0 and np.isnan(found["lift_cm"])
    assert found["floor_turn"] == pytest.approx(1, abs=0.05)
    assert found["peak_deg_s"] == pytest.approx(60, rel=0.05)
    assert found["head_lead_deg"] == pytest.approx(0, abs=0.1)


def test_who_glides_aside_takes_no_steps() -> None:
    found = figures.strafing(take(4.0, x=1.0 * time(4.0)))
    assert found["speed_mps"] == pytest.approx(1.0) and found["lifts_per_m"] == 0
    assert np.isnan(found["foot_way_cm"]) and found["slide_cm_s"] == pytest.approx(100, rel=0.01)


def test_a_body_that_glides_around_a_circle_leans_nowhere_and_looks_ahead() -> None:
    angle = 0.6 * time(6.0)
    made = take(6.0, x=2 * np.cos(angle), y=2 * np.sin(angle), heading=np.degrees(angle))
    found = figures.curving(made)
    assert found["speed_mps"] == pytest.approx(1.2, abs=0.01) and found["lifts_per_m"] == 0
    assert found["lean_share"] == pytest.approx(0, abs=0.05)
    assert found["head_in_deg"] == pytest.approx(0, abs=0.1)


def test_raised_arms_are_seen_in_turning_back() -> None:
    t = time(4.0)
    made = take(4.0, heading=180 * np.clip(t - 1, 0, 1))
    assert figures.turning_back(made)["arm_up"] == 1, "a T-pose"
    hanging = take(4.0, heading=180 * np.clip(t - 1, 0, 1), **HANGING)
    assert figures.turning_back(hanging)["arm_up"] == 0


def test_a_stop_is_measured_from_where_it_has_slowed() -> None:
    way = np.concatenate([1.2 * time(2.0), np.full(3 * FPS, 2.4)])
    found = figures.stopping(take(5.0, y=way))
    assert 0 <= found["to_rest_s"] < 0.3 and found["footfalls"] == 0
    assert np.isnan(figures.stopping(take(3.0, y=time(3.0)))["to_rest_s"]), "goes on"
