"""The world's foot lock: the next step starts from the frames that were sent."""

from collections import defaultdict

import numpy as np

from tests.world.fakes import FakeEngine
from tests.world.output.legwork import body, soles_of, standing
from wayfarer.world.agents.agent import AgentChange, AgentSpec, ChunkFlag, MotionChunk, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering
from wayfarer.world.output.twobone import MOVED
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

SLOW = Goal((0.0, 5.0, 0.0), speed=0.2)  # the fake engine glides there without a step
OTHERS = [j for j in range(22) if j not in MOVED]


def world_of(*specs: AgentSpec, engine: FakeEngine | None = None) -> tuple[World, list[str]]:
    bodies = {gender: body() for gender in ("female", "male")}
    settings = WorldSettings(steering=Steering(reactions=1))
    world = World(engine or FakeEngine(), bodies, standing(1)[1][0], settings)
    world.create_session(SessionSpec("s", avoid=False), 0.0)
    return world, [a.agent_id for a in world.create_agents("s", specs, 0.0)]


def tracks(chunks: list[MotionChunk]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Hips [1, F, 3] and rotations [1, F, 22, 4] by agent."""
    by_agent = defaultdict(list)
    for chunk in chunks:
        by_agent[chunk.agent_id].append(chunk)
    return {
        agent: tuple(
            np.concatenate([getattr(c, name) for c in own])[None]
            for name in ("translation", "rotations")
        )
        for agent, own in by_agent.items()
    }


def test_an_agent_may_have_its_feet_locked_or_not():
    world, [with_lock, without] = world_of(AgentSpec(), AgentSpec(foot_lock=False))
    for agent in (with_lock, without):
        world.give(agent, SLOW, 0.0)
    found = tracks(list(world.advance(2.0)))
    (hips, locked), (plain_hips, plain) = found[with_lock], found[without]
    np.testing.assert_array_equal(hips[..., :2], plain_hips[..., :2])  # the model goes the same way
    np.testing.assert_array_equal(locked[:, :, OTHERS], plain[:, :, OTHERS])
    slid = [
        np.linalg.norm(np.diff(soles_of(hips, turns)[0, :8], axis=0)[..., :2], axis=-1).sum(0).max()
        for turns in (locked, plain)
    ]
    assert slid[0] < 0.1 * slid[1]


def test_feet_do_not_jump_at_seams_or_when_a_goal_is_changed():
    world, [agent] = world_of(AgentSpec())
    world.give(agent, SLOW, 0.0)
    chunks = list(world.advance(1.05))
    world.give(agent, Goal((5.0, 0.0, 0.0), speed=0.2), 1.05)
    chunks += list(world.advance(3.0))
    assert any(chunk.flags & ChunkFlag.REPLANNED for chunk in chunks)
    hips, rotations = tracks(chunks)[agent]
    feet = soles_of(hips, rotations)[0].mean(2)
    assert np.linalg.norm(np.diff(feet, axis=0), axis=-1).max() < 0.006  # 0.2 m/s and the leash


def test_the_next_step_starts_from_what_was_sent():
    world, [agent] = world_of(AgentSpec())
    world.give(agent, SLOW, 0.0)
    chunks = list(world.advance(1.0))
    slot = world.registry.agent(agent).slot
    seed = world.slots.committed.seed
    np.testing.assert_array_equal(seed.rotations[slot], chunks[-1].rotations[-2:])
    pose = standing(1)[1][0, 0]
    assert np.abs(seed.rotations[slot, -1, MOVED] - pose[MOVED]).max() > 0.01
    names = body().marker_names
    off = seed.markers[slot, -1] - seed.translation[slot, -1]
    apart = off[names.index("LANK"), 1] - off[names.index("ARIEL"), 1]
    assert apart < -0.02, "its ankles stay behind, also for the model"


def test_agents_of_one_moment_are_cleaned_together_and_apart_alike():
    specs = [AgentSpec(position=(3.0 * i, 0.0), noise_seed=i, foot_lock=i != 1) for i in range(3)]
    world, agents = world_of(*specs)
    for agent in agents:
        world.give(agent, SLOW, 0.0)
    together = tracks(list(world.advance(2.0)))
    for spec, agent in zip(specs, agents, strict=True):
        alone_world, [alone] = world_of(spec)
        alone_world.give(alone, SLOW, 0.0)
        found = tracks(list(alone_world.advance(2.0)))[alone]
        shared = min(found[0].shape[1], together[agent][0].shape[1])
        np.testing.assert_allclose(together[agent][1][:, :shared], found[1][:, :shared], atol=1e-5)


def test_a_lock_that_is_switched_on_begins_where_the_feet_are():
    world, [agent] = world_of(AgentSpec(foot_lock=False))
    world.give(agent, SLOW, 0.0)
    plain = list(world.advance(2.0))
    world.update_agent(agent, AgentChange(foot_lock=True))
    locked = list(world.advance(3.0))
    world.update_agent(agent, AgentChange(foot_lock=False))
    list(world.advance(6.0))
    world.update_agent(agent, AgentChange(foot_lock=True))
    again = list(world.advance(7.0))
    for chunks in (plain + locked, again):
        hips, rotations = tracks(chunks)[agent]
        feet = soles_of(hips, rotations)[0].mean(2)
        assert np.linalg.norm(np.diff(feet, axis=0), axis=-1).max() < 0.006  # 0.2 m/s
    assert np.abs(locked[1].rotations[:, MOVED] - plain[0].rotations[:, MOVED]).max() > 0.001
