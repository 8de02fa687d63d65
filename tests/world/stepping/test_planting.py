"""Feet of a standing agent: they stay where they were planted, however the model drifts."""

from dataclasses import replace

import numpy as np
import pytest

from wayfarer.spec import MARKERS, NEW_FRAMES, POSED_JOINTS, SEED_FRAMES
from wayfarer.world.agents.slots import Gait, Mode, Seeds
from wayfarer.world.stepping.planting import MAX_SHIFT, WIDTH, Step, plant

SOLES = np.arange(8).reshape(2, 4)
HEAD = 20
FEET = np.array([[-0.1, -0.1], [-0.15, 0.05], [-0.05, 0.05], [-0.1, 0.12]], np.float32)


def person() -> np.ndarray:
    """Markers [67, 3]: two soles, 20 cm apart, and everything else at the head; it faces +Y."""
    markers = np.tile(np.array([0.0, 0.0, 1.7], np.float32), (MARKERS, 1))
    markers[SOLES[0], :2], markers[SOLES[1], :2] = FEET, FEET * [-1, 1]
    markers[SOLES.ravel(), 2] = 0.0
    return markers


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    moved = points.copy()
    moved[..., :2] = points[..., :2] @ np.array([[cos, sin], [-sin, cos]])
    return moved.astype(np.float32)


def standing(markers: np.ndarray) -> tuple[Gait, Seeds]:
    gait, seed = Gait.empty(1), Seeds.empty(1)
    gait.mode[:] = Mode.STANDING
    seed.markers[:] = markers
    seed.rotations[..., 3] = 1
    return gait, seed


def drifted(seed: Seeds, shift: tuple[float, float], angle: float = 0.0, foot: float = 0.0) -> Step:
    """What a model would bring that moves by `shift` and turns by `angle`, as one body, in the
    course of the step; `foot` moves the left foot alone outwards.
    """
    share = np.linspace(0, 1, NEW_FRAMES + 1)[1:]
    start = seed.markers[0, -1]
    way = np.outer(share, [*shift, 0.0])  # [F, 3]
    frames = np.stack([turned(start, angle * s) for s in share]) + way[:, None]
    frames[:, SOLES[0], 0] -= foot * share[:, None]
    rotations = np.zeros((1, NEW_FRAMES, POSED_JOINTS, 4), np.float32)
    rotations[..., 3] = 1
    half = (angle * share + yaw(seed.rotations[0, -1, 0])) / 2
    rotations[0, :, 0, 2], rotations[0, :, 0, 3] = np.sin(half), np.cos(half)
    hips = np.array([*(seed.translation[0, -1, :2]), 0.9])
    translation = np.stack([turned(hips, angle * s) for s in share]) + way
    return Step(
        translation[None].astype(np.float32),
        rotations,
        frames[None, -SEED_FRAMES:].astype(np.float32),
        np.ones((1, NEW_FRAMES, 2), np.bool_),
    )


def yaw(hips: np.ndarray) -> float:
    return float(2 * np.arctan2(hips[2], hips[3]))


def planted(
    gait: Gait, seed: Seeds, raw: Step, carried: tuple[float, float] = (0.0, 0.0)
) -> tuple[Gait, Step, Seeds]:
    velocity = np.array([carried] * len(gait.mode), np.float32)
    return plant(SOLES, gait, seed, raw, velocity)


@pytest.mark.parametrize(
    ("shift", "angle", "foot"),
    [((0.001, -0.0005), 0.0, 0.0), ((0.0, 0.0), 0.002, 0.0), ((0.001, 0.0), -0.002, 0.0005)],
    ids=["moves", "turns", "moves, turns, and one foot goes aside"],
)
def test_a_minute_of_drift_moves_no_foot(
    shift: tuple[float, float], angle: float, foot: float
) -> None:
    gait, seed = standing(person())
    for _ in range(300):
        gait, _step, seed = planted(gait, seed, drifted(seed, shift, angle, foot))
    soles = seed.markers[0, -1, SOLES.ravel()]
    assert np.linalg.norm(soles - person()[SOLES.ravel()], axis=-1).max() < 1e-3
    if not foot:  # a foot that goes aside takes half of its way from the hips of this model
        assert np.linalg.norm(seed.translation[0, -1, :2]) < 0.01
    assert np.degrees(abs(yaw(seed.rotations[0, -1, 0]))) < 1


def test_hips_that_turn_over_planted_feet_are_turned_back() -> None:
    gait, seed = standing(person())
    gait.stop_facing[:] = 0, 1
    for _ in range(300):
        raw = drifted(seed, (0.0, 0.0))
        half = (yaw(seed.rotations[0, -1, 0]) + np.linspace(0, 0.003, NEW_FRAMES)) / 2
        raw.rotations[0, :, 0, 2], raw.rotations[0, :, 0, 3] = np.sin(half), np.cos(half)
        gait, _step, seed = planted(gait, seed, raw)
    assert 1 < np.degrees(yaw(seed.rotations[0, -1, 0])) < 3, "52 degrees in all; a few are free"
    soles = seed.markers[0, -1, SOLES.ravel()]
    assert np.linalg.norm(soles - person()[SOLES.ravel()], axis=-1).max() < 1e-3


def test_nothing_jumps_at_the_seam_and_the_head_goes_along() -> None:
    gait, seed = standing(person())
    raw = drifted(seed, (0.008, 0.0))
    _, step, _ = planted(gait, seed, raw)
    moved = np.diff(step.translation[0, :, 0] - raw.translation[0, :, 0], prepend=0.0)
    assert abs(moved[0]) < 5e-4 and np.abs(moved).max() < 2e-3
    assert step.markers[0, -1, HEAD, 0] == pytest.approx(0.0, abs=1e-4)


def test_a_large_error_is_taken_off_over_several_steps() -> None:
    gait, seed = standing(person())
    gait, step, _ = planted(gait, seed, drifted(seed, (0.05, 0.0)))
    assert step.markers[0, -1, HEAD, 0] == pytest.approx(0.05 - MAX_SHIFT, abs=1e-4)


@pytest.mark.parametrize("foot", [0, 1])
def test_a_lifted_foot_is_planted_where_it_comes_down(foot: int) -> None:
    gait, seed = standing(person())
    gait, step, seed = planted(gait, seed, drifted(seed, (0.0, 0.0)))
    lifted = drifted(seed, (0.03, 0.0))
    lifted.contacts[0, 3:5, foot] = False
    gait, step, seed = planted(gait, seed, lifted)
    assert not gait.planted.any()
    np.testing.assert_array_equal(step.translation, lifted.translation)
    gait, step, seed = planted(gait, seed, drifted(seed, (0.001, 0.0)))
    assert gait.planted.all()
    np.testing.assert_allclose(gait.soles[0, 0, 0, 0], FEET[0, 0] + 0.03, atol=1e-5)


@pytest.mark.parametrize("mode", [Mode.WALKING, Mode.TURNING])
def test_whoever_moves_is_left_alone(mode: Mode) -> None:
    gait, seed = standing(person())
    gait = replace(gait, mode=np.array([mode], np.int8), planted=np.array([True]))
    raw = drifted(seed, (0.01, 0.0))
    gait, step, _ = planted(gait, seed, raw)
    assert step is raw and not gait.planted.any()


def test_a_row_is_its_own_and_a_broken_one_spoils_no_other() -> None:
    alone_gait, alone_seed = standing(person())
    raw = drifted(alone_seed, (0.001, 0.002), 0.001, 0.0003)
    _, alone, _ = planted(alone_gait, alone_seed, raw)

    index = np.zeros(3, np.int64)
    together = Step(*(np.repeat(values, 3, axis=0) for values in raw))
    together.markers[1] = np.nan
    together.contacts[2, 0, 0] = False
    with np.errstate(invalid="ignore"):
        gait, found, _ = planted(alone_gait.take(index), alone_seed.take(index), together)
    for values, own in zip(found, alone, strict=True):
        np.testing.assert_array_equal(values[0], own[0])
    np.testing.assert_array_equal(found.translation[2], raw.translation[0])
    assert gait.planted.tolist() == [True, True, False]


@pytest.mark.parametrize("behind", [0, 1], ids=["left", "right"])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_foot_behind_comes_up_to_the_other_when_a_walk_ends(
    behind: int, heading: float
) -> None:
    split = person()
    split[SOLES[behind], 1] -= 0.25
    gait, seed = standing(turned(split, heading))
    seed.rotations[:, :, 0, 2:] = np.sin(heading / 2), np.cos(heading / 2)
    front = seed.markers[0, -1, SOLES[1 - behind]].copy()
    for _ in range(20):
        gait, _step, seed = planted(gait, seed, drifted(seed, (0.0, 0.0)))
    soles = turned(seed.markers[0, -1], -heading)[SOLES].mean(1)
    assert abs(soles[0, 1] - soles[1, 1]) < 0.01
    assert soles[1, 0] - soles[0, 0] == pytest.approx(0.2, abs=0.01)
    np.testing.assert_allclose(seed.markers[0, -1, SOLES[1 - behind]], front, atol=1e-3)


def test_feet_side_by_side_stay_as_they_are() -> None:
    stands = person()
    stands[SOLES[0], 1] += 0.03
    gait, seed = standing(stands)
    _, step, _ = planted(gait, seed, drifted(seed, (0.0, 0.0)))
    np.testing.assert_allclose(step.markers[0, -1, SOLES], stands[SOLES], atol=1e-6)


def test_crossed_feet_are_uncrossed() -> None:
    crossed = person()
    crossed[SOLES[0], 0] += 0.15
    crossed[SOLES[1], 0] -= 0.15
    gait, seed = standing(crossed)
    for _ in range(20):
        gait, _step, seed = planted(gait, seed, drifted(seed, (0.0, 0.0)))
    soles = seed.markers[0, -1, SOLES].mean(1)
    assert soles[1, 0] - soles[0, 0] > 0.8 * WIDTH[0]


def test_in_side_steps_the_standing_body_is_carried_with_its_feet() -> None:
    gait, seed = standing(person())
    gait.mode[:] = Mode.STRAFING
    shown = [seed.translation[0, -1, 0]]
    for speed in (0.2, 0.4, 0.6, 0.6, 0.6):
        gait, step, seed = planted(gait, seed, drifted(seed, (0.001, 0.0)), (speed, 0.0))
        shown += step.translation[0, :, 0].tolist()
        np.testing.assert_allclose(gait.carried[0], [speed, 0], atol=1e-6)
    velocity = np.diff(shown) * 40
    assert velocity[-8:] == pytest.approx(0.6, abs=0.05)
    assert np.abs(np.diff(velocity)).max() < 0.05, "it speeds up evenly"
    way = 0.2 * (0.1 + 0.3 + 0.5 + 0.6 + 0.6)
    np.testing.assert_allclose(gait.soles[0, :, :, 0].mean(), way, atol=2e-3)
    np.testing.assert_allclose(seed.markers[0, -1, HEAD, 0], way, atol=2e-3)
    np.testing.assert_allclose(seed.translation[0, 0], seed.translation[0, 1], atol=1e-3)


def test_who_stops_after_side_steps_comes_to_rest_by_degrees() -> None:
    gait, seed = standing(person())
    gait.mode[:] = Mode.STRAFING
    gait, _, seed = planted(gait, seed, drifted(seed, (0.0, 0.0)), (0.4, 0.0))
    gait.mode[:] = Mode.STOPPING
    gait, step, seed = planted(gait, seed, drifted(seed, (0.0, 0.0)), (0.2, 0.0))
    assert step.translation[0, -1, 0] - step.translation[0, 0, 0] > 0.04
    gait, step, seed = planted(gait, seed, drifted(seed, (0.0, 0.0)))
    gait, step, seed = planted(gait, seed, drifted(seed, (0.0, 0.0)))
    assert np.ptp(step.translation[0, :, 0]) < 1e-4
