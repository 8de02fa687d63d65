"""A long run: agents go from goal to goal for minutes, and their health is watched."""

from collections import defaultdict
from dataclasses import dataclass
from math import hypot, tau
from typing import Final

import numpy as np

from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.evaluation.gait import Windows
from wayfarer.evaluation.goals import DISTANCE, Watch
from wayfarer.evaluation.health import Health
from wayfarer.evaluation.tracks import Track, skin_track
from wayfarer.runtime.agent import AgentSpec, AgentState, ChunkFlag, Goal, MotionChunk
from wayfarer.runtime.world import World
from wayfarer.spec import NEW_FRAMES
from wayfarer.stage import Bodies

PATIENCE: Final = 20.0
"""Seconds after which a goal that was not reached is replaced."""

REST: Final = 2.0
"""Seconds that an agent stands before it is sent on."""

RANGE: Final = 50.0
"""Metres from the origin within which goals lie."""

BLOCK: Final = 25
"""Chunks skinned together: 5 s."""

KEPT: Final = 4
"""One block in so many keeps a window of gait."""


@dataclass(frozen=True)
class Wandering:
    """What a long run has shown."""

    health: list[Health]
    gait: list[Windows]
    goals_given: int
    goals_reached: int
    resets: int


def wander(
    world: World,
    bodies: Bodies,
    specs: list[AgentSpec],
    seconds: float,
    random: np.random.Generator,
    watch: Watch = lambda done, total: None,
) -> Wandering:
    """Send agents from goal to goal, 3 … 8 m apart, for `seconds` of motion."""
    session = world.create_session(None, 0.0).session_id
    agents = [a.agent_id for a in world.create_agents(session, specs, 0.0)]
    spec_of = dict(zip(agents, specs, strict=True))
    health = {a: Health(_rest_height(bodies, spec)) for a, spec in spec_of.items()}
    waiting: dict[str, list[MotionChunk]] = defaultdict(list)
    since = dict.fromkeys(agents, 0.0)  # of the goal, or of the stand
    revision = dict.fromkeys(agents, 0)  # of the goal an agent is on the way to; 0: none
    given = reached = blocks = 0
    gait: list[Windows] = []

    for chunk in world.advance(seconds):
        agent, now = chunk.agent_id, chunk.scheduled_at
        waiting[agent].append(chunk)
        if len(waiting[agent]) == BLOCK:
            track = _watch_health(health[agent], bodies, spec_of[agent], waiting.pop(agent))
            blocks += 1
            if blocks % KEPT == 0:
                gait.append(track[: 5 * NEW_FRAMES].windows())
        if revision[agent] and chunk.goal_revision == revision[agent]:
            reached += ChunkFlag.ARRIVED in chunk.flags
            if chunk.state == AgentState.STANDING:
                revision[agent], since[agent] = 0, now
        if now - since[agent] >= (PATIENCE if revision[agent] else REST):
            revision[agent] = world.set_goal(agent, _next_goal(world, agent, random), now)
            since[agent] = now
            given += 1
        watch(now, seconds)
    for agent, chunks in waiting.items():
        _watch_health(health[agent], bodies, spec_of[agent], chunks)
    world.delete_session(session)
    return Wandering(list(health.values()), gait, given, reached, world.resets)


def _watch_health(
    health: Health, bodies: Bodies, spec: AgentSpec, chunks: list[MotionChunk]
) -> Track:
    hips = np.concatenate([c.translation for c in chunks])
    rotations = np.concatenate([c.rotations for c in chunks])
    track = skin_track(bodies[spec.gender], np.array(spec.betas), hips, rotations)
    health.watch(track, matrix_from_quaternion(rotations[:, 0])[..., 2])
    return track


def _next_goal(world: World, agent: str, random: np.random.Generator) -> Goal:
    x, y, _ = world.get_agent(agent).position
    while True:
        angle, distance = random.uniform(0, tau), random.uniform(*DISTANCE)
        there = (x + distance * np.cos(angle), y + distance * np.sin(angle))
        # someone outside the range is let back in by any goal that is nearer than he is
        if hypot(*there) < max(RANGE, hypot(x, y)):
            return Goal((float(there[0]), float(there[1]), 0.0))


def _rest_height(bodies: Bodies, spec: AgentSpec) -> float:
    return float(bodies[spec.gender].rest_joints(np.array(spec.betas))[0, 2])
