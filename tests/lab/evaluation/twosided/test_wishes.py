"""Wishes by formula."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.twosided.wishes import ORDERS, SECONDS, Wish

TIME = np.arange(round((SECONDS + 2) * FPS)) / FPS


def wish(name: str) -> Wish:
    return ORDERS[name](TIME, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("name", "way"),
    [("walk 1.2", (0, 1.2)), ("left", (-1, 0)), ("right", (1, 0)), ("back", (0, -0.9))],
)
def test_ways_are_those_of_the_speed(name: str, way: tuple[float, float]) -> None:
    ways = wish(name).ways(5 * FPS, np.array([7.0, -3.0]))
    assert ways == pytest.approx(np.outer([0.2, 0.5, 1.0], way))
    assert wish(name).facings(5 * FPS) == pytest.approx(np.array([[0, 1.0]] * 3))


def test_who_stays_is_asked_back_and_not_far() -> None:
    stand = wish("stand")
    assert not stand.ways(100, np.zeros(2)).any()
    assert stand.ways(100, np.array([0.1, 0])) == pytest.approx(
        np.array([[-0.01, 0], [-0.025, 0], [-0.05, 0]])
    )
    assert np.abs(stand.ways(100, np.array([9.0, 0]))).max() < 0.1


def test_turns_and_curves_end_where_they_shall() -> None:
    turned = np.degrees(wish("turn 90").heading)
    assert abs(turned[round(4.5 * FPS)]) == pytest.approx(90) and abs(turned[-1]) == pytest.approx(
        90
    )
    assert np.ptp(np.degrees(wish("turn 180").heading)) >= 180
    curve = wish("curve")
    places = curve.velocity.cumsum(0) / FPS
    late = places[4 * FPS :]
    middle = (late.max(0) + late.min(0)) / 2
    assert np.linalg.norm(late - middle, axis=-1) == pytest.approx(2.0, abs=0.15)


def test_turning_back_changes_the_way_every_2_s() -> None:
    back = wish("turn back")
    speed = np.linalg.norm(back.velocity[3 * FPS :], axis=-1)
    assert speed == pytest.approx(1.2)
    assert (back.velocity[round(2.9 * FPS)] @ back.velocity[round(4.9 * FPS)]) < -1.4


def test_measured_parts_lie_in_the_twelve_seconds() -> None:
    for name in ORDERS:
        parts = [part for found in wish(name).parts.values() for part in found]
        assert parts
        assert all(0 <= part.start < part.stop <= SECONDS * FPS for part in parts)
