"""Bodies that lean into a curve by formula."""

import numpy as np
import pytest

from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import leaning

TIME = np.arange(6 * FPS) / FPS


def on_a_circle(
    lean: float, turn: float, speed: float = 1.2, radius: float = 2.0
) -> tuple[np.ndarray, ...]:
    """Ankles [T, 2, 3], head and hips [T, 3] of a body that leans inward by some degrees."""
    angle = turn * speed / radius * TIME
    outward = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    foot = radius * outward
    head = foot - np.tan(np.radians(lean)) * 1.6 * outward + np.array([0, 0, 1.6])
    ankles = np.stack([foot, foot], 1)
    return ankles, head, foot + np.array([0, 0, 0.9])


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_lean_is_measured_against_physics(turn: float) -> None:
    asked = np.degrees(np.arctan(1.2**2 / 2.0 / 9.81))
    ankles, head, hips = on_a_circle(asked, turn)
    assert leaning.asked(hips) == pytest.approx(turn * asked, rel=0.03)
    assert leaning.inward(ankles, head, hips, turn) == pytest.approx(asked, rel=0.05)
    assert leaning.share_of_asked(ankles, head, hips) == pytest.approx(1, rel=0.06)


def test_who_stays_upright_or_leans_out_is_told() -> None:
    assert leaning.share_of_asked(*on_a_circle(0.0, 1.0)) == pytest.approx(0, abs=0.02)
    assert leaning.share_of_asked(*on_a_circle(-4.0, 1.0)) == pytest.approx(-0.95, rel=0.1)


def test_nothing_is_said_of_a_straight_way() -> None:
    ankles, head, hips = on_a_circle(0.0, 1.0, radius=1000.0)
    assert np.isnan(leaning.share_of_asked(ankles, head, hips))
