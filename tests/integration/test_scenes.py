"""The shipped model in a scene: up a slope and down steps."""

import numpy as np
import pytest

from tests.runtime.kept_worlds import shipped_bundle
from wayfarer.models.bundle import START_POSES
from wayfarer.navigation.examples import slope_with_steps
from wayfarer.navigation.scene import bake
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentSpec, ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.output.legs import pose_legs
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World


def walker(scene, place):
    """A world, and an agent at a place."""
    bundle, registry = shipped_bundle(), SceneRegistry()
    scene_id = registry.create(SceneSource(scene.spec), baked=scene).scene_id
    poses = load_start_poses(START_POSES)
    world = World(bundle.engine, bundle.bodies, poses, WorldSettings(), scenes=registry)
    world.create_session(SessionSpec("s", scene=scene_id), 0.0)
    [agent] = world.create_agents("s", [AgentSpec(position=place)], 0.0)
    return world, agent.agent_id


def walked(world, until):
    """Chunks until the goal is reached, or for `seconds`."""
    chunks = []
    for chunk in world.advance(until):
        chunks.append(chunk)
        if chunk.flags & ChunkFlag.ARRIVED:
            break
    return chunks


def hips(chunks):
    return np.concatenate([chunk.translation for chunk in chunks])


def test_feet_are_on_a_slope_and_on_steps():
    scene = bake(slope_with_steps())
    world, agent = walker(scene, (10.0, 2.0))
    world.give(agent, Goal((10.0, 17.0, 0.0)), 0.0)
    chunks = walked(world, 30.0)
    assert chunks[-1].flags & ChunkFlag.ARRIVED
    translation = hips(chunks)
    assert translation[:, 2].max() > 2.0  # on the platform
    slot = np.array([world.registry.agent(agent).slot])
    rotations = np.concatenate([chunk.rotations for chunk in chunks])
    pose = pose_legs(world.slots.legs.take(slot), translation[None], rotations[None])
    soles = pose.soles[0]  # [F, 2, P, 3]
    gaps = (soles[..., 2] - scene.floor(soles)).min(-1)
    contacts = np.concatenate([chunk.contacts for chunk in chunks])
    assert np.abs(gaps[contacts]).mean() < 0.02
    assert (gaps < -0.05).mean() < 0.01
    rise = FPS * np.diff(translation[:, 2])
    assert np.abs(rise).max() < 2.0  # m/s: nothing jumps
    # An agent's place is the model's; the foot lock sends the hips up to 8 mm lower (`LOWERED`).
    assert world.get_agent(agent).position[2] == pytest.approx(translation[-1, 2], abs=0.009)
