"""Feet whose lifts, slips and turns are known."""

import numpy as np
import pytest

from tests.lab.evaluation.metrics.motions import bump, feet, ramp
from wayfarer_lab.evaluation.metrics import feet as measure

T = 80


def both(left: np.ndarray | float, right: np.ndarray | float = 0.0) -> np.ndarray:
    return np.stack(np.broadcast_arrays(np.zeros(T) + left, np.zeros(T) + right), -1)


def test_a_lift_counts_once_and_only_when_it_is_high_enough() -> None:
    once = bump(T, 10, 20, 0.05)
    assert measure.lift_count(both(once)) == 1
    assert measure.lift_count(both(once, bump(T, 40, 20, 0.05))) == 2, "both feet count"
    assert measure.lift_count(both(once + bump(T, 40, 20, 0.05))) == 2
    assert measure.lift_count(both(bump(T, 10, 20, 0.014))) == 0, "a foot that shuffles"
    assert measure.lift_count(both(0.03)) == 0, "that was up before the take began"
    wavering = np.where(once > 0.012, 0.016 + 0.004 * np.cos(np.arange(T)), once)
    assert measure.lift_count(both(wavering)) == 1, "it did not come down in between"


def test_lifts_have_heights() -> None:
    tops = measure.lift_tops(both(bump(T, 10, 21, 0.05), bump(T, 40, 21, 0.08)))
    assert tops == pytest.approx([0.05, 0.08], rel=0.02)
    assert measure.lift_tops(both(0.0)) == []


def test_a_sole_that_pivots_under_load_reports_its_angle() -> None:
    soles = feet(T, turn=both(ramp(T, 20, 60, 30.0)))
    left, right = measure.stances(soles)
    assert (left.foot, right.foot) == (0, 1)
    assert left.turn == pytest.approx(30.0) and right.turn == pytest.approx(0.0)
    assert measure.pivot([left, right]) == pytest.approx(15.0), "a mean of both feet"


def test_to_and_fro_is_a_turn_too() -> None:
    there = ramp(T, 10, 30, 20.0) - ramp(T, 40, 60, 20.0)
    assert measure.stances(feet(T, turn=both(there)))[0].turn == pytest.approx(20.0)


def test_a_turn_across_180_degrees_does_not_jump() -> None:
    soles = feet(T, turn=both(170 + ramp(T, 10, 60, 30.0)))
    assert measure.stances(soles)[0].turn == pytest.approx(30.0)


def test_a_foot_that_turns_in_the_air_does_not_pivot() -> None:
    swing = bump(T, 20, 40, 0.08)
    soles = feet(T, turn=both(ramp(T, 30, 50, 60.0)), height=both(swing))
    found = measure.stances(soles)
    assert measure.pivot(found) == pytest.approx(0.0, abs=0.1)
    assert [s.foot for s in found] == [0, 1, 0], "two stances of the foot that stepped"


def test_slip_is_what_the_patch_on_the_ground_moves() -> None:
    soles = feet(T, place=both(ramp(T, 20, 60, 0.10)))
    left, right = measure.stances(soles)
    assert left.slip == pytest.approx(0.10) and right.slip == 0
    back = feet(T, place=both(ramp(T, 10, 30, 0.10) - ramp(T, 40, 60, 0.10)))
    assert measure.stances(back)[0].slip == pytest.approx(0.10), "coming back does not undo it"


def test_a_foot_that_rolls_over_its_toe_does_not_slip() -> None:
    soles = feet(T, pitch=both(ramp(T, 20, 60, 50.0)))
    assert measure.stances(soles)[0].slip < 0.005
    dragged = feet(T, pitch=both(ramp(T, 20, 60, 50.0)), place=both(ramp(T, 20, 60, 0.05)))
    assert measure.stances(dragged)[0].slip == pytest.approx(0.05, abs=0.005)


def test_a_low_swing_is_no_slip_but_a_skate_on_both_feet_is() -> None:
    swing = ramp(T, 30, 50, 0.6)  # 1.2 m/s at no height, while the other foot stands
    assert max(s.slip for s in measure.stances(feet(T, place=both(swing)))) < 0.05
    skate = measure.stances(feet(T, place=both(swing, swing)))
    assert max(s.slip for s in skate) == pytest.approx(0.6)


def test_slides_do_not_ask_whether_a_foot_bears() -> None:
    creep = ramp(T, 0, T - 1, 0.2)
    assert max(measure.slides(*_with_height(place=both(creep)))) == pytest.approx(0.2)
    hovering = _with_height(place=both(creep), height=both(0.02, 0.02))
    assert max(measure.slides(*hovering)) == pytest.approx(0.2), "2 cm up all the time"
    stepped = _with_height(place=both(ramp(T, 30, 50, 0.2)), height=both(bump(T, 28, 26, 0.06)))
    assert max(measure.slides(*stepped)) < 0.005, "a step is no slide"


def test_floating_is_the_lower_foot() -> None:
    up = both(0.05, bump(T, 20, 20, 0.06))
    assert measure.floating(up).mean() == pytest.approx(2 / 3 * 20 / T, abs=2 / T)
    assert not measure.floating(both(0.5, 0.0)).any(), "one foot on the ground is enough"
    assert measure.floats_seen(up) and not measure.floats_seen(both(0.05, bump(T, 20, 8, 0.05)))


def test_who_hops_or_hovers_is_airborne() -> None:
    hop = bump(T, 20, 20, 0.05)
    soles, height = _with_height(height=both(hop, hop))
    assert measure.airborne(soles, height) == pytest.approx(16 / T, abs=3 / T)
    assert measure.airborne(*_with_height(height=both(hop, 0.0))) == 0
    assert measure.airborne(*_with_height(height=both(0.02, 0.02))) == 1


def test_contact_is_false_of_a_foot_that_is_up() -> None:
    told = np.ones((T, 2), bool)
    swing = both(np.where(np.arange(T) < 20, 0.05, 0.0))
    assert measure.false_contact(told, swing) == pytest.approx(20 / (2 * T))
    assert measure.false_contact(swing < 0.01, swing) == 0, "told truly"
    assert np.isnan(measure.false_contact(~told, swing))
    assert np.isnan(measure.contact_while_floating(told, swing)), "the other foot stands"
    floats = both(0.05, np.where(np.arange(T) < 10, 0.05, 0.0))
    assert measure.contact_while_floating(told, floats) == 1
    assert measure.contact_while_floating(~told, floats) == 0


def test_the_foot_that_leaves_first() -> None:
    early, late = bump(T, 10, 20, 0.05), bump(T, 40, 20, 0.05)
    assert measure.first_foot(both(early, late)) == 0
    assert measure.first_foot(both(late, early)) == 1
    assert measure.first_foot(both(0.0)) is None


def test_double_support_is_neither_foot_lifted() -> None:
    walk = both(np.where(np.arange(T) < 30, 0.05, 0.0), np.where(np.arange(T) > 49, 0.05, 0.0))
    assert measure.double_support(walk) == pytest.approx(20 / T)


def _with_height(**how: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    soles = feet(T, **how)
    return soles, measure.heights(soles)
