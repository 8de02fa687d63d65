"""Bodies on uneven ground: from frames on the flat floor to frames on the ground."""

from itertools import pairwise

import numpy as np
import pytest

from tests.world.output.legwork import legs, moved, soles_of, standing
from tests.world.output.test_footlock import walk
from wayfarer.spec import FPS
from wayfarer.world.output.ground import Grounded, set_on_ground
from wayfarer.world.output.ground import standing as at_height
from wayfarer.world.output.twobone import MOVED

OTHERS = [joint for joint in range(22) if joint not in MOVED]
SLOPE = 0.2
TREAD, RISE = 0.35, 0.2


def level(points):
    return np.full(points.shape[:-1], 1.5)


def slope(points):
    return SLOPE * points[..., 1]


def stairs(points):
    return RISE * np.floor(points[..., 1] / TREAD)


def grounded(translation, rotations, floor, pieces=()) -> Grounded:
    """The motion from its first frame, in one call or cut at the frames `pieces`."""
    first = floor(translation[:, :1, :2])[:, 0]
    footing, places, turns = at_height(first), [], []
    for start, stop in pairwise(sorted({0, *pieces, translation.shape[1]})):
        made = set_on_ground(
            footing,
            legs(len(translation)),
            translation[:, start:stop],
            rotations[:, start:stop],
            floor,
        )
        footing = made.footing
        places.append(made.translation)
        turns.append(made.rotations)
    return Grounded(np.concatenate(places, 1), np.concatenate(turns, 1), footing)


def gaps(made, floor):
    """Heights of all sole points above the floor [A, F, 2, P]."""
    soles = soles_of(made.translation, made.rotations)
    return soles[..., 2] - floor(soles)


def test_a_level_floor_raises_all_as_it_is():
    translation, rotations = walk()
    made = grounded(translation, rotations, level)
    expected = translation + np.float32([0, 0, 1.5])
    np.testing.assert_allclose(made.translation, expected, atol=1e-5)
    same = np.abs((made.rotations * rotations).sum(-1))
    np.testing.assert_allclose(same, 1, atol=1e-5)


def test_who_stands_on_a_slope_has_both_soles_flat_on_it():
    translation, rotations = standing(80)
    made = grounded(translation, rotations, slope)
    assert np.abs(gaps(made, slope)[:, -1]).max() < 5e-3
    assert made.rotations[:, :, OTHERS].tobytes() == rotations[:, :, OTHERS].tobytes()


def test_feet_that_glide_up_a_slope_stay_on_it():
    translation, rotations = standing(160)
    made = grounded(moved(translation, (0.0, 0.9, 0.0)), rotations, slope)
    assert np.abs(gaps(made, slope)).mean() < 0.02


@pytest.mark.parametrize("floor", [slope, stairs])
def test_hips_rise_smoothly_and_no_foot_goes_through_a_step(floor):
    translation, rotations = standing(160)
    translation = moved(translation, (0.0, 0.9, 0.0))
    made = grounded(translation, rotations, floor)
    assert gaps(made, floor).min() > -0.05
    speed = FPS * np.diff(made.translation[..., 2], axis=1)
    assert np.abs(FPS * np.diff(speed, axis=1)).max() < 9.81
    risen = made.translation[0, -1, 2] - translation[0, -1, 2]
    assert risen == pytest.approx(float(floor(translation[0, -1])), abs=0.25)


def test_frames_in_pieces_are_those_in_one():
    translation, rotations = walk()
    translation = moved(translation, (0.0, 0.8, 0.0))
    whole = grounded(translation, rotations, stairs)
    parts = grounded(translation, rotations, stairs, (8, 16, 17, 40))
    np.testing.assert_allclose(parts.translation, whole.translation, atol=1e-6)
    np.testing.assert_allclose(parts.rotations, whole.rotations, atol=1e-6)


def test_an_agents_result_is_its_own():
    translation, rotations = walk()
    both = np.concatenate([translation, translation + np.float32([0, 0.1, 0])])
    turns = np.concatenate([rotations, rotations])
    together = grounded(both, turns, stairs)
    for agent in (0, 1):
        mine = slice(agent, agent + 1)
        alone = grounded(both[mine], turns[mine], stairs)
        assert alone.rotations.tobytes() == together.rotations[mine].tobytes()
        assert alone.translation.tobytes() == together.translation[mine].tobytes()


def downstairs(points):
    return -RISE * np.floor(points[..., 1] / TREAD)


@pytest.mark.parametrize("floor", [stairs, downstairs])
@pytest.mark.parametrize("stop", np.arange(0.9, 1.25, 0.05).round(2).tolist())
def test_downstairs_all_of_a_sole_comes_down_on_one_tread(floor, stop):
    translation, rotations = standing(80)
    left = np.clip(1 - np.arange(80) / 48, 0, 1)
    translation[..., 1] += stop * (1 - left**2)  # and there it stands
    made = grounded(translation, rotations, floor)
    before = soles_of(translation, rotations)[0, -1, 0, :, 1]
    after = soles_of(made.translation, made.rotations)[0, -1, 0, :, 1]
    if floor is stairs:
        np.testing.assert_allclose(after, before, atol=0.01)
    else:
        heel, toe = after[0] + 0.02, after[-1] - 0.02
        assert np.floor(heel / TREAD) == np.floor(toe / TREAD)
        assert np.abs(after - before).max() < 0.16
