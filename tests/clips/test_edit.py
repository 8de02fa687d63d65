"""Rates, root motion and cycles of clips."""

from dataclasses import replace

import numpy as np
import pytest

from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.clips.clip import Clip
from wayfarer.clips.edit import looped, put_back, relative_to, resampled, root_track
from wayfarer.clips.files import BodyDetail, FileOptions, Performance, RootMotion, _actor
from wayfarer.errors import InvalidArgument
from wayfarer.spec import POSED_JOINTS

STRIDE_S = 1.1


def walk(seconds: float = 6.0, turn: float = 0.0, noise: float = 0.0, speed: float = 1.3) -> Clip:
    """Legs that swing, hips that sway, on a line or an arc; `noise` makes no two steps alike."""
    frames = round(seconds * 40)
    time = np.arange(frames) / 40
    phase = 2 * np.pi * time / STRIDE_S
    heading = 0.4 + turn * time
    steps = np.stack([-np.sin(heading), np.cos(heading)], 1) * speed / 40
    path = np.cumsum(steps, 0)
    sway = np.stack([np.cos(heading), np.sin(heading)], 1) * 0.03 * np.sin(phase)[:, None]
    height = 0.9 + 0.02 * np.sin(2 * phase)
    turns = np.zeros((frames, POSED_JOINTS, 4))
    turns[..., 3] = 1
    half = heading / 2
    turns[:, 0] = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], 1)
    rng = np.random.default_rng(0)
    for joint, sign in ((1, 1), (2, -1)):
        swing = 0.25 * sign * np.sin(phase) + noise * np.cumsum(rng.normal(size=frames)) / 40
        turns[:, joint] = np.stack([np.sin(swing), 0 * swing, 0 * swing, np.cos(swing)], 1)
    return Clip(
        translation=np.concatenate([path + sway, height[:, None]], 1),
        rotations=turns,
        contacts=np.stack([np.sin(phase) > 0, np.sin(phase) < 0], 1),
        gender="female",
        betas=(0.0,) * 10,
    )


@pytest.mark.parametrize("fps", [10.0, 24.0, 29.97, 30.0, 60.0, 120.0])
def test_another_rate_is_the_same_motion(fps):
    clip = walk()
    found = resampled(clip, fps)
    assert found.fps == fps
    assert abs((found.frames - 1) / fps - (clip.frames - 1) / 40) < 1 / fps
    again = np.stack(
        [
            np.interp(np.arange(found.frames) / fps, np.arange(clip.frames) / 40, column)
            for column in clip.translation.T
        ],
        1,
    )
    np.testing.assert_allclose(found.translation, again, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found.rotations, axis=-1), 1, atol=1e-9)


def test_keys_that_fall_on_frames_are_kept():
    clip = walk()
    found = resampled(clip, 120.0)
    np.testing.assert_allclose(found.translation[::3], clip.translation, atol=1e-9)
    same = np.abs((found.rotations[::3] * clip.rotations).sum(-1))
    np.testing.assert_allclose(same, 1, atol=1e-12)


@pytest.mark.parametrize("fps", [0.0, -1.0, 1e9, float("nan")])
def test_no_rate_is_refused(fps):
    with pytest.raises(InvalidArgument, match="fps is"):
        resampled(walk(), fps)


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_in_place_keeps_sway_and_takes_the_path(turn):
    clip = walk(turn=turn)
    root = root_track(clip)
    still = relative_to(clip, root)
    inner = still.translation[40:-40]
    assert np.abs(inner[:, :2]).max() < (0.08 if turn else 0.05)  # it stays
    assert np.ptp(inner[:, 0]) > 0.04  # and sways by 3 cm to both sides
    facing = matrix_from_quaternion(still.rotations[:, 0])[:, :, 1]
    assert np.abs(facing[:, 0]).max() < 0.12
    speed = np.linalg.norm(np.diff(root.places, axis=0), axis=-1)[40:-40] * 40
    assert speed == pytest.approx(1.3, rel=0.03)  # steady, whatever the hips do
    back = put_back(still, root)
    np.testing.assert_allclose(back.translation, clip.translation, atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.4])
@pytest.mark.parametrize("root", [RootMotion.IN_PLACE, RootMotion.BONE, RootMotion.HIPS])
@pytest.mark.parametrize("fps", [None, 30.0, 24.0])
def test_the_ends_of_a_cycle_meet(turn, root, fps):
    clip = walk(turn=turn, noise=0.02)
    options = FileOptions(loop=True, root=root, fps=fps, detail=BodyDetail.LOW)
    actor = _actor(Performance("Ada", clip), options)
    found = actor.clip
    assert abs((found.frames - 1) / found.fps - STRIDE_S) < 0.06
    if root is RootMotion.HIPS:
        found = relative_to(found, root_track(found, loops=True))
    np.testing.assert_allclose(found.translation[0], found.translation[-1], atol=1e-6)
    same = np.abs((found.rotations[0] * found.rotations[-1]).sum(-1))
    np.testing.assert_allclose(same, 1, atol=1e-9)
    # motion over the seam is as smooth as elsewhere
    places = np.concatenate([found.translation[:-1], found.translation[:-1]])
    jerk = np.abs(np.diff(places, 2, axis=0)).max(1) * found.fps**2
    assert jerk[found.frames - 3 : found.frames].max() < 1.5 * jerk[: found.frames - 3].max() + 0.5


@pytest.mark.parametrize("clip", [walk(speed=0.0), walk(0.5), walk(0.025)])
def test_what_has_no_cycle_is_refused(clip):
    with pytest.raises(InvalidArgument, match="no cycle was found"):
        looped(clip)


def test_the_body_of_the_clip_is_that_of_the_cycle():
    clip = replace(walk(), gender="male", goals=((0.0, 9.0, 0.0),))
    assert (looped(clip).gender, looped(clip).goals) == (clip.gender, clip.goals)
