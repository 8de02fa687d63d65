"""Smooth roots: no lag, no sway, and the phase of the legs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.runtime.chunks import chunk, together
from tests.runtime.streams.stage import Stage, take
from tests.wire_poses import quaternions_to_core
from wayfarer.runtime.streams.root_tracks import RootTracks
from wayfarer.transport.conversion.basis import Basis

WALK = json.loads((Path(__file__).parents[2] / "golden" / "walk.json").read_text())


def walked(seq, speed=1.0, sway=0.0, agent="a"):
    """Eight frames along +X, with a sway across it at two steps a second."""
    at = (8 * seq + np.arange(8)) / 40
    place = np.stack([speed * at, sway * np.sin(2 * np.pi * at), np.full(8, 0.9)], axis=-1)
    made = chunk(seq, agent)
    rotations = np.zeros((8, 22, 4), np.float32)
    rotations[..., 3] = 1
    return replace(made, translation=place.astype(np.float32), rotations=rotations)


def doubled(rows):
    """Frames at 40 per second from frames at 20."""
    between = (rows + np.concatenate([rows[1:], rows[-1:]])) / 2
    return np.stack([rows, between], axis=1).reshape(-1, *rows.shape[1:])


def followed(tracks, chunks):
    return np.concatenate([tracks.follow(together(made))[0] for made in chunks])


def test_a_root_has_no_lag_and_little_sway():
    roots = followed(RootTracks(), [walked(seq, sway=0.03) for seq in range(25)])
    at = np.arange(50) / 10
    assert np.abs(roots[30:, 0] - at[30:]).max() < 0.01
    assert np.abs(roots[30:, 1]).max() < 0.025 and np.allclose(roots[:, 2], 0.9)


def test_a_root_starts_in_place_after_a_gap_and_a_jump():
    tracks = RootTracks()
    followed(tracks, [walked(seq) for seq in range(10)])
    after = tracks.follow(together(walked(20)))[0]
    assert after[0, 0] == pytest.approx(4.0)
    moved = walked(21)
    after = tracks.follow(together(replace(moved, translation=moved.translation + 5)))[0]
    assert after[0, 0] == pytest.approx(9.2)


def test_rows_do_not_depend_on_each_other():
    alone, both = RootTracks(), RootTracks()
    for seq in range(5):
        a, b = walked(seq, 1.0, 0.02, "a"), walked(seq, 2.0, 0.05, "b")
        np.testing.assert_array_equal(alone.follow(together(b))[0], both.follow(together(a, b))[1])
    both.forget("a")
    assert len(both) == 1


def test_the_phase_is_that_of_the_legs():
    """A walk sent by a server: strikes show in the contacts."""
    axes = Basis.GLTF.axes
    hips = axes.points_to_core(doubled(np.array(WALK["hips"])))
    rotations = quaternions_to_core(axes, doubled(np.array(WALK["rotations"]).reshape(-1, 22, 4)))
    parts = [
        replace(chunk(k), translation=hips[8 * k :][:8], rotations=rotations[8 * k :][:8])
        for k in range(15)
    ]
    roots = followed(RootTracks(), parts)
    phases = np.unwrap(roots[:12, 4], period=1.0)
    # the right leg is farthest forward at the walk's frames 0 and 22, of 20 a second
    assert phases[0] == pytest.approx(0.5, abs=0.05)
    assert phases[11] - phases[0] == pytest.approx(1.0, abs=0.08)
    assert (np.diff(phases) > 0.02).all() and phases[5] == pytest.approx(0.95, abs=0.1)
    assert (roots[3:10, 5] > 0.7).all()
    still = roots[22:25]
    assert (still[:, 5] < 0.5).all() and np.ptp(still[:, 4]) < 0.1


async def test_publications_have_roots_once_somebody_asks():
    stage = Stage()
    plain = await stage.subscribe()
    await stage.walk(1)
    asking = await stage.subscribe(roots=True)
    await stage.walk(1)
    (first, second), [third] = await take(plain, 2), await take(asking, 1)
    assert first.roots is None
    assert second.roots is third.roots is not None and second.roots.shape == (1, 2, 6)
    chosen = await stage.subscribe("b", roots=True)
    await stage.walk(1, "a", "b")
    [found] = await take(chosen, 1)
    assert found.roots.shape == (1, 2, 6)
    stage.publisher.forget_agent("s", "a")
    assert len(stage.publisher._logs["s"].roots) == 1
