"""Counts by hand."""

import numpy as np
import pytest

from tests.world.fakes import motion_chunk
from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.agent import ChunkFlag
from wayfarer_lab.evaluation.scenes.measures import WORST, Depths, Gaps, ProgressWatch


def test_depths_count_frames_from_1_and_from_5_cm() -> None:
    depths = Depths()
    depths.add(np.array([0.0, -0.2, 0.008, 0.02, 0.06]), np.arange(5), np.full(5, 3))
    assert (depths.frames, depths.touching, depths.deep) == (5, 2, 1)
    assert depths.mean == pytest.approx(0.04) and depths.deepest == pytest.approx(0.06)
    assert depths.share(depths.touching) == pytest.approx(0.4)


def test_the_worst_are_the_deepest_moments_of_different_agents() -> None:
    depths = Depths()
    for frame in range(10):
        depths.add(np.array([0.01 * frame, 0.02]), np.array([4, 9]), np.full(2, frame))
    assert depths.worst[0] == (pytest.approx(0.09), 4, 9)
    assert [agent for _, agent, _ in depths.worst] == [4, 9]
    depths.add(np.full(20, 0.5), np.arange(20), np.zeros(20, int))
    assert len(depths.worst) == WORST


def test_nothing_seen_is_not_nothing_wrong() -> None:
    assert np.isnan(Depths().share(0)) and Gaps("gap").figures() == {}


def test_gaps_are_magnitudes() -> None:
    gaps = Gaps("gap")
    gaps.add(np.array([0.02, -0.04]))
    assert gaps.figures()["gap_mean_cm"] == pytest.approx(3.0)


def chunk(number: int, x: float, revision: int = 1, waypoint: int = 0, arrived: bool = False):
    return motion_chunk(
        number,
        goal_revision=revision,
        flags=ChunkFlag.ARRIVED if arrived else ChunkFlag.NONE,
        translation=np.tile(np.float32([x, 0, 1]), (NEW_FRAMES, 1)),
        waypoint=waypoint,
    )


def test_who_stays_within_30_cm_for_10_s_on_the_way_is_stuck() -> None:
    progress = ProgressWatch()
    for number in range(100):
        progress.see(chunk(number, 0.1 * (number % 2)))
    assert progress.stuck_at == pytest.approx(10.0)
    assert progress.stuck_seconds == pytest.approx(10.0, abs=0.3)


def test_who_creeps_is_not_stuck() -> None:
    progress = ProgressWatch()
    for number in range(200):
        progress.see(chunk(number, 0.01 * number))
    assert progress.stuck_at is None


def test_who_has_no_goal_or_has_arrived_may_stand() -> None:
    idle, there = ProgressWatch(), ProgressWatch()
    for number in range(200):
        idle.see(chunk(number, 0.0, revision=0))
        there.see(chunk(number, 0.0, arrived=number == 5))
    assert idle.stuck_at is None and there.stuck_at is None
    assert there.arrivals == 1


def test_a_next_goal_starts_the_wait_anew() -> None:
    progress = ProgressWatch()
    for number in range(45):
        progress.see(chunk(number, 0.0, arrived=number == 3))
    for number in range(45, 90):
        progress.see(chunk(number, 0.0, waypoint=1))
    assert progress.stuck_at is None, "9 s of the second goal"
    for number in range(90, 100):
        progress.see(chunk(number, 0.0, waypoint=1))
    assert progress.stuck_at is not None
