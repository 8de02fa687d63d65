"""Faults of made bodies, fed in pieces."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.evaluation.health import OFF_FLOOR_FRAMES, Health, health_row
from wayfarer.evaluation.tracks import Track

UP = np.array([0.0, 0.0, 1.0])


def standing(frames: int, lift: float | np.ndarray = 0.0) -> Track:
    hips = np.tile([0.0, 0.0, 0.9], (frames, 1))
    hips[:, 2] += lift
    markers = hips[:, None] + np.array([[0.1, 0.0, -0.9], [-0.1, 0.0, -0.9], [0.0, 0.0, 0.8]])
    return Track(markers, hips)


def watched(track: Track, up: np.ndarray = UP, pieces: int = 1) -> Health:
    health = Health(rest_height=0.9)
    axes = np.broadcast_to(up, (len(track.hips), 3))
    for part in np.array_split(np.arange(len(track.hips)), pieces):
        if len(part):
            piece = slice(part[0], part[-1] + 1)
            health.watch(track[piece], axes[piece])
    return health


def test_a_standing_body_is_well() -> None:
    health = watched(standing(100))
    assert health.frames == 100
    assert not any(health.faults.values())


@pytest.mark.parametrize(
    ("lift", "fault"), [(0.1, "floating"), (-0.1, "sunk"), (-0.5, "fallen"), (-0.5, "sunk")]
)
def test_bodies_off_the_floor(lift: float, fault: str) -> None:
    assert watched(standing(100, lift)).faults[fault] == 100


def test_a_tilted_body_has_fallen() -> None:
    leaning, lying = np.radians(50), np.radians(70)
    assert (
        watched(standing(9), np.array([np.sin(leaning), 0, np.cos(leaning)])).faults["fallen"] == 0
    )
    assert watched(standing(9), np.array([np.sin(lying), 0, np.cos(lying)])).faults["fallen"] == 9


def test_exploded_and_not_finite() -> None:
    track = standing(10)
    track.markers[3, 0, 0] = 100.0
    track.markers[5, 0, 0] = np.nan
    faults = watched(track).faults
    assert faults["exploded"] == 1 and faults["nan"] == 1


@given(flight=st.integers(0, 60), pieces=st.integers(1, 30))
def test_only_long_flights_count_and_pieces_do_not_matter(flight: int, pieces: int) -> None:
    lift = np.zeros(100)
    lift[20 : 20 + flight] = 0.2
    expected = flight if flight >= OFF_FLOOR_FRAMES else 0
    assert watched(standing(100, lift), pieces=pieces).faults["floating"] == expected


def test_a_row_counts_agents_and_frames() -> None:
    row = health_row("two", [watched(standing(100)), watched(standing(100, 0.1))], resets=3)
    assert row["agents"] == 2 and row["resets"] == 3
    assert row["floating_agents"] == 1 and row["floating_share"] == 0.5
    assert row["fallen_agents"] == 0
    assert row["minutes_each"] == pytest.approx(100 / 40 / 60)
