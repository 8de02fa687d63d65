"""Walks at half or twice their rate are reported; those at the right rate are not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.lab.training.mocap.synthetic import stepping
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.floor import ANKLES
from wayfarer_lab.training.mocap.pace import odd_pace, pace
from wayfarer_lab.training.mocap.rig import SourceClip


def walk(cadence: float, step: float, size: float = 1.0, seconds: float = 8.0) -> SourceClip:
    """`cadence` steps a second of `step` metres, of a person of `size` times 1.7 m."""
    frames = round(FPS / cadence)
    clip = stepping(round(seconds * FPS), step / size * FPS / frames, frames)
    return replace(clip, places=clip.places * size, rest=clip.rest * size)


@pytest.mark.parametrize(
    ("cadence", "step", "size"),
    [(1.8, 0.7, 1.0), (1.4, 0.5, 1.0), (2.2, 0.8, 1.0), (2.2, 0.55, 0.75), (1.67, 0.85, 1.2)],
)
def test_walks_of_people_are_not_odd_but_at_half_or_twice_their_rate(cadence, step, size) -> None:
    clip = walk(cadence, step, size)
    found = pace(clip)
    assert found is not None
    assert found.cadence == pytest.approx(FPS / round(FPS / cadence), rel=0.05)
    assert found.speed == pytest.approx(found.cadence * step, rel=0.1)
    assert odd_pace(clip) is None
    half = odd_pace(walk(cadence / 2, step, size, 16.0))
    assert "is its frame rate half the true one?" in str(half)
    assert "the column `fps`" in str(half).lower()
    if cadence > 1.6:  # a stroll at twice its rate is a quick walk
        assert "is its frame rate twice the true one?" in str(
            odd_pace(walk(2 * cadence, step, size))
        )


def test_a_quick_run_is_none_since_its_heels_swing_up() -> None:
    clip = walk(3.6, 0.9)
    assert odd_pace(clip) is not None
    swing = clip.places[:, ANKLES, 2] - clip.places[:, ANKLES, 2].min()
    clip.places[:, ANKLES, 2] += 3 * swing
    assert odd_pace(clip) is None


def test_only_forward_walking_of_some_steps_is_judged() -> None:
    clip = walk(0.9, 0.7, seconds=16.0)
    assert odd_pace(clip) is not None
    assert odd_pace(replace(clip, info=replace(clip.info, locomotion=False))) is None
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert pace(replace(clip, rotations=turn @ clip.rotations)) is None  # sideways
    assert pace(clip.cut(0, 120)) is None
    still = replace(clip, places=np.broadcast_to(clip.places[:1], clip.places.shape))
    assert pace(still) is None
