"""Faults of made bodies, fed in pieces."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.lab.evaluation.people import BODIES
from wayfarer.spec import BETAS
from wayfarer_lab.evaluation.health import OFF_FLOOR_FRAMES, TILTED_FRAMES, MotionHealth, health_row
from wayfarer_lab.evaluation.metrics.trunk import Trunk
from wayfarer_lab.evaluation.tracks import BodyTrack, skin_track

BODY = BODIES["female"]


def health() -> MotionHealth:
    return MotionHealth(rest_height=0.9, trunk=Trunk.of(BODY))


def watched(
    frames: int,
    lift: float | np.ndarray = 0.0,
    lean: float | np.ndarray = 0.0,
    heading: float | np.ndarray = 0.0,
    near: bool | np.ndarray = False,
    pieces: int = 1,
) -> MotionHealth:
    """A body in its T-pose, lifted so many metres, leaning or else facing so many radians."""
    hips = np.tile([0.0, 0.0, 0.9], (frames, 1))
    hips[:, 2] += lift
    turns = np.zeros((frames, 22, 4))
    turns[..., 3] = 1.0
    half = np.broadcast_to(np.asarray(lean, float) + heading, frames) / 2
    turns[:, 0, 2 if np.any(heading) else 0], turns[:, 0, 3] = np.sin(half), np.cos(half)
    track = skin_track(BODY, np.zeros(BETAS), hips, turns)
    seen, close = health(), np.broadcast_to(near, frames)
    for part in np.array_split(np.arange(frames), pieces):
        if len(part):
            piece = slice(part[0], part[-1] + 1)
            seen.watch(track[piece], turns[piece, 0], close[piece])
    return seen


def test_a_standing_body_is_well() -> None:
    seen = watched(100, near=True)
    assert seen.frames == 100
    assert not any(seen.faults.values())


@pytest.mark.parametrize(
    ("lift", "fault"), [(0.1, "floating"), (-0.1, "sunk"), (-0.5, "fallen"), (-0.5, "sunk")]
)
def test_bodies_off_the_floor(lift: float, fault: str) -> None:
    assert watched(100, lift).faults[fault] == 100


def test_a_lying_body_has_fallen() -> None:
    assert watched(9, lean=np.radians(50)).faults["fallen"] == 0
    assert watched(9, lean=np.radians(70)).faults["fallen"] == 9


@pytest.mark.parametrize(
    ("degrees", "frames", "tilted"),
    [(24, 80, 0), (26, TILTED_FRAMES - 1, 0), (26, TILTED_FRAMES, TILTED_FRAMES)],
)
def test_a_tilt_counts_when_it_lasts_a_second(degrees: float, frames: int, tilted: int) -> None:
    lean = np.zeros(120)
    lean[10 : 10 + frames] = np.radians(degrees)
    assert watched(120, lean=lean).faults["tilted"] == tilted


def test_exploded_and_not_finite() -> None:
    turns = np.zeros((10, 22, 4))
    turns[..., 3] = 1.0
    track = skin_track(BODY, np.zeros(BETAS), np.tile([0.0, 0.0, 0.9], (10, 1)), turns)
    track.markers[3, 20, 0] = 100.0
    track.markers[5, 20, 0] = np.nan
    seen = health()
    seen.watch(track, turns[:, 0], np.zeros(10, bool))
    assert seen.faults["exploded"] == 1 and seen.faults["nan"] == 1


@given(flight=st.integers(0, 60), pieces=st.integers(1, 30))
def test_only_long_flights_count_and_pieces_do_not_matter(flight: int, pieces: int) -> None:
    lift = np.zeros(100)
    lift[20 : 20 + flight] = 0.2
    expected = flight if flight >= OFF_FLOOR_FRAMES else 0
    assert watched(100, lift, pieces=pieces).faults["floating"] == expected


@pytest.mark.parametrize(("turn", "spins"), [(530, False), (550, True), (-550, True)])
def test_one_and_a_half_turns_near_a_goal_are_spinning(turn: float, spins: bool) -> None:
    heading = np.radians(np.linspace(0, turn, 200))
    for pieces in (1, 7):
        assert (watched(200, heading=heading, near=True, pieces=pieces).faults["spinning"] > 0) == (
            spins
        )


def test_turning_elsewhere_or_to_and_fro_is_no_spinning() -> None:
    heading = np.radians(np.linspace(0, 2000, 400))
    assert watched(400, heading=heading).faults["spinning"] == 0
    apart = np.arange(400) % 100 != 0  # leaves the goal's neighbourhood once in a turn and a half
    assert watched(400, heading=heading, near=apart).faults["spinning"] == 0
    to_and_fro = np.radians(300) * np.sin(np.linspace(0, 30, 400))
    assert watched(400, heading=to_and_fro, near=True).faults["spinning"] == 0


def test_a_row_counts_agents_and_frames() -> None:
    row = health_row("two", [watched(100), watched(100, 0.1)], resets=3)
    assert row["agents"] == 2 and row["resets"] == 3
    assert row["floating_agents"] == 1 and row["floating_share"] == 0.5
    assert row["fallen_agents"] == row["tilted_agents"] == row["spinning_agents"] == 0
    assert row["minutes_each"] == pytest.approx(100 / 40 / 60)


def test_a_track_of_nothing_changes_nothing() -> None:
    seen = health()
    seen.watch(
        BodyTrack(np.zeros((0, 67, 3)), np.zeros((0, 3)), np.zeros((0, 22, 4))),
        np.zeros((0, 4)),
        np.zeros(0, bool),
    )
    assert seen.frames == 0 and not any(seen.faults.values())
