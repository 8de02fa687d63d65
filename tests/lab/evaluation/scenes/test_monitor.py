"""A monitor of bodies whose every place is known: T-poses that glide."""

import numpy as np
import pytest

from tests.lab.evaluation.people import ANNY
from tests.world.fakes import motion_chunk
from wayfarer.navigation.examples import rectangle
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Box, Floor, SceneSpec
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.agent import AgentSpec, MotionChunk
from wayfarer_lab.evaluation.scenes.monitor import SceneMonitor

HIPS = float(ANNY["female"].rest_joints(np.zeros(10))[0, 2])


def scene(*boxes: Box) -> Scene:
    return bake(SceneSpec((Floor(rectangle(-10, -10, 10, 10)),), boxes))


def chunk(agent: str, number: int, at: tuple[float, float, float]) -> MotionChunk:
    return motion_chunk(
        number,
        agent_id=agent,
        goal_revision=1,
        translation=np.tile(np.float32(at) + np.float32([0, 0, HIPS]), (NEW_FRAMES, 1)),
        contacts=np.ones((NEW_FRAMES, 2), bool),
    )


def watched(
    where: Scene, ways: dict[str, list[tuple[float, float, float]]], **options
) -> SceneMonitor:
    monitor = SceneMonitor(ANNY, where, **options)
    for agent in ways:
        monitor.meet(agent, AgentSpec())
    for number, places in enumerate(zip(*ways.values(), strict=True)):
        for agent, at in zip(ways, places, strict=True):
            monitor.see(chunk(agent, number, at))
    monitor.finish()
    return monitor


def test_arms_in_a_wall_are_found_and_hands_above_a_low_box_are_free() -> None:
    tall, low = Box((1.0, 0.0), (1.0, 1.0), 2.0), Box((1.0, 0.0), (1.0, 1.0), 0.4)
    ways = {"a": [(0.1, 0.0, 0.0)] * 5}  # a T-pose reaches 0.7 m to the side
    inside = watched(scene(tall), ways).figures()
    assert inside["penetration_frames"] == 1.0 and inside["penetration_max_cm"] > 5
    above = watched(scene(low), ways).figures()
    assert above["penetration_frames"] == 0.0
    assert above["agent_frames"] == 10, "every fourth of 40"


def test_depth_in_a_wall_is_the_hands_own() -> None:
    away = watched(scene(Box((1.0, 0.0), (0.4, 4.0), 2.0)), {"a": [(0.0, 0.0, 0.0)]})
    near = watched(scene(Box((0.9, 0.0), (0.4, 4.0), 2.0)), {"a": [(0.0, 0.0, 0.0)]})
    assert near.walls.deepest == pytest.approx(max(away.walls.deepest, 0) + 0.1, abs=0.11)


def test_bodies_in_each_other_count_for_both_when_they_share_a_world() -> None:
    ways = {"a": [(0.0, 0.0, 0.0)] * 3, "b": [(0.0, 0.1, 0.0)] * 3, "c": [(5.0, 5.0, 0.0)] * 3}
    figures = watched(scene(), ways).figures()
    assert figures["overlap_frames"] == pytest.approx(2 / 3)
    assert "overlap_frames" not in watched(scene(), ways, strangers=False).figures()


def test_feet_on_the_floor_above_it_and_below_it() -> None:
    for lift, expected in ((0.0, 0.0), (0.03, 3.0), (-0.03, 3.0)):
        figures = watched(scene(), {"a": [(0.0, 0.0, lift)]}).figures()
        assert figures["foot_gap_mean_cm"] == pytest.approx(expected, abs=0.3)
        assert "foot_gap_uneven_mean_cm" not in figures, "all of it is level"


def test_feet_at_a_ledge_are_on_uneven_ground() -> None:
    ledge = scene(Box((0.0, 5.0), (4.0, 9.6), 0.2))
    figures = watched(ledge, {"a": [(0.0, 0.35, 0.2)]}).figures()
    assert figures["foot_gap_uneven_mean_cm"] == pytest.approx(0.0, abs=0.3)
    assert figures["penetration_frames"] == 0.0, "standing on it is not being in it"


def test_the_edge_of_the_floor_is_no_step() -> None:
    figures = watched(scene(), {"a": [(0.0, 9.9, 0.0)]}).figures()
    assert "foot_gap_uneven_mean_cm" not in figures


def test_a_change_of_the_scene_counts_from_then_on() -> None:
    monitor = SceneMonitor(ANNY, scene(), every=1)
    monitor.meet("a", AgentSpec())
    monitor.see(chunk("a", 0, (0.0, 0.0, 0.0)))
    monitor.change(scene().put("crate", Box((0.5, 0.0), (0.6, 0.6), 2.0)))
    monitor.see(chunk("a", 1, (0.0, 0.0, 0.0)))
    monitor.finish()
    assert monitor.figures()["penetration_frames"] == 0.5
    assert monitor.worst()[0]["at_s"] >= NEW_FRAMES / FPS


def test_long_runs_are_judged_as_they_pass_and_lose_nothing() -> None:
    ways = {"a": [(0.0, 0.0, 0.0)] * 60, "b": [(3.0, 0.0, 0.0)] * 60}
    monitor = watched(scene(), ways)
    assert monitor.figures()["agent_frames"] == 2 * 60 * NEW_FRAMES / 4
    assert monitor.trail(1).shape == (60, 3)
