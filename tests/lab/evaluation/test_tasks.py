"""Errands through the real world, with an engine that glides."""

import numpy as np
import pytest

from tests.lab.evaluation.people import BODIES, make_world
from wayfarer.spec import FPS, GENDERS
from wayfarer.world.agents.agent import AgentInfo
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.tasks import (
    AgentTask,
    TimedCommand,
    Trajectory,
    random_specs,
    relative,
    run_tasks,
)


def ahead(agent: AgentInfo) -> list[Goal]:
    return [Goal(relative(agent, 3.0, 0.0))]


def behind(agent: AgentInfo) -> list[Goal]:
    return [Goal(relative(agent, -3.0, 0.0))]


def trajectories(*orders: TimedCommand, seconds: float = 6.0, seed: int = 0) -> list[Trajectory]:
    tasks = [AgentTask(spec, orders) for spec in random_specs(3, np.random.default_rng(seed))]
    return run_tasks(make_world(), tasks, seconds)


def test_a_course_begins_with_the_first_frame_for_its_order() -> None:
    for trajectory in trajectories(TimedCommand(0.0, ahead)):
        assert trajectory.given[0].frame == 0 and len(trajectory.given) == 1
        start = np.linalg.norm(trajectory.hips[0, :2] - trajectory.spec.position)
        assert 0 < start < 0.2, "2 s of standing are left out"
        way = trajectory.hips[-1, :2] - trajectory.spec.position
        direction = np.array([-np.sin(trajectory.spec.heading), np.cos(trajectory.spec.heading)])
        assert way @ direction == pytest.approx(3.0, abs=0.3), "the goal is straight ahead"
        assert trajectory.goal == trajectory.given[0].path[-1]
        assert len(trajectory.hips) >= 5.5 * FPS


def test_a_later_order_is_given_when_its_time_has_come() -> None:
    for trajectory in trajectories(TimedCommand(0.0, ahead), TimedCommand(1.0, behind)):
        turn = trajectory.given[1].frame
        assert turn == pytest.approx(1.0 * FPS, abs=8)
        latest = trajectory.latest()
        assert latest.given[0].frame == 0 and latest.goal == trajectory.given[1].path[0]
        assert len(latest.hips) == len(trajectory.hips) - turn
        home = np.linalg.norm(trajectory.hips[:, :2] - trajectory.hips[turn, :2], axis=-1)
        assert home[-1] == pytest.approx(3.0, abs=0.4), "3 m behind where it then was"


def test_a_course_is_skinned_on_its_own_body() -> None:
    trajectory = trajectories(TimedCommand(0.0, ahead))[0]
    track = trajectory.track(BODIES[trajectory.spec.gender], slice(0, 20))
    assert track.markers.shape == (20, 67, 3)
    assert abs(track.markers[..., 2].min()) < 0.01, "spawned on the floor"


def test_the_seed_decides_everything() -> None:
    first, again, other = (
        trajectories(TimedCommand(0.0, ahead), seed=seed)[0] for seed in (3, 3, 4)
    )
    assert np.array_equal(first.hips, again.hips)
    assert first.spec != other.spec


def test_progress_is_told_in_seconds_of_motion() -> None:
    told: list[tuple[float, float]] = []
    tasks = [AgentTask(random_specs(1, np.random.default_rng(0))[0], (TimedCommand(0.0, ahead),))]
    run_tasks(make_world(), tasks, 2.0, watch=lambda done, total: told.append((done, total)))
    assert {total for _, total in told} == {4.0}
    assert max(done for done, _ in told) <= 4.0


def test_specs_are_of_both_genders_and_many_shapes() -> None:
    specs = random_specs(10, np.random.default_rng(0))
    assert [s.gender for s in specs] == list(GENDERS) * 5
    assert len({s.betas for s in specs}) == len({s.position for s in specs}) == 10
    assert max(abs(b) for s in specs for b in s.betas) <= 2.0
