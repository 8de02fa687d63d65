"""A long run: agents walk from goal to goal for minutes, and faults are counted."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, hypot, tau
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.model_bundle import Bodies
from wayfarer.spec import NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec, AgentState, ChunkFlag, MotionChunk, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.world import World
from wayfarer_lab.evaluation.figures import distances
from wayfarer_lab.evaluation.gait import Windows
from wayfarer_lab.evaluation.health import SPIN_RANGE, MotionHealth
from wayfarer_lab.evaluation.metrics.trunk import Trunk
from wayfarer_lab.evaluation.tasks import Watch
from wayfarer_lab.evaluation.tracks import BodyTrack, skin_track

Array = NDArray[np.floating[Any]]

DISTANCE: Final = (3.0, 8.0)
"""Metres to the next goal."""

PATIENCE: Final = 20.0
"""Seconds after which a goal that was not reached is replaced."""

REST: Final = 2.0
"""Seconds that an agent stands before its next goal."""

RANGE: Final = 50.0
"""Metres from the origin within which goals lie."""

BLOCK: Final = 25
"""Chunks skinned together: 5 s."""

KEPT: Final = 2000
"""Windows of gait kept at most, spread over the run: bounds memory (64 MB)."""

NOWHERE: Final = (np.inf, np.inf, 0.0)
"""Used as the goal of an agent that has none."""


@dataclass(frozen=True)
class Wandering:
    """Results of a long run."""

    health: list[MotionHealth]
    gait: list[Windows]
    goals_given: int
    goals_reached: int
    resets: int


def wander(
    world: World,
    bodies: Bodies,
    specs: Sequence[AgentSpec],
    seconds: float,
    random: np.random.Generator,
    watch: Watch = lambda done, total: None,
) -> Wandering:
    """Send agents from goal to goal, 3 … 8 m apart, for `seconds` of motion."""
    session = world.create_session(SessionSpec(avoid=False), 0.0).session_id
    agents = [a.agent_id for a in world.create_agents(session, specs, 0.0)]
    spec_of = dict(zip(agents, specs, strict=True))
    health = {a: _healthy(bodies, spec) for a, spec in spec_of.items()}
    waiting: dict[str, list[tuple[MotionChunk, tuple[float, float, float]]]] = defaultdict(list)
    since = dict.fromkeys(agents, 0.0)  # of the goal, or of the stand
    revision = dict.fromkeys(agents, 0)  # of the goal an agent is on the way to; 0: none
    ahead = dict.fromkeys(agents, NOWHERE)  # the goal that is not reached yet
    keep_every = ceil(len(specs) * seconds / (BLOCK * STEP_SECONDS) / KEPT)
    given = reached = blocks = 0
    gait: list[Windows] = []

    for chunk in world.advance(seconds):
        agent, now = chunk.agent_id, chunk.scheduled_at
        is_answer = revision[agent] > 0 and chunk.goal_revision == revision[agent]
        waiting[agent].append((chunk, ahead[agent] if is_answer else NOWHERE))
        if len(waiting[agent]) == BLOCK:
            track = _watch(health[agent], bodies, spec_of[agent], waiting.pop(agent))
            blocks += 1
            if blocks % keep_every == 0:
                gait.append(track[: 5 * NEW_FRAMES].windows())
        if is_answer:
            if ChunkFlag.ARRIVED in chunk.flags:
                reached, ahead[agent] = reached + 1, NOWHERE
            # an agent with a new goal still stands for a moment, and has not arrived
            if chunk.state == AgentState.STANDING and ahead[agent] == NOWHERE:
                revision[agent], since[agent] = 0, now
        if now - since[agent] >= (PATIENCE if revision[agent] else REST):
            goal = _next_goal(world, agent, random)
            revision[agent] = world.give(agent, goal, now)
            since[agent], ahead[agent] = now, goal.position
            given += 1
        watch(now, seconds)
    for agent, chunks in waiting.items():
        _watch(health[agent], bodies, spec_of[agent], chunks)
    world.delete_session(session)
    return Wandering(list(health.values()), gait, given, reached, world.scheduler.resets)


def _healthy(bodies: Bodies, spec: AgentSpec) -> MotionHealth:
    body, betas = bodies[spec.gender], np.array(spec.betas)
    return MotionHealth(float(body.rest_joints(betas)[0, 2]), Trunk.of(body, betas))


def _watch(
    health: MotionHealth,
    bodies: Bodies,
    spec: AgentSpec,
    chunks: Sequence[tuple[MotionChunk, tuple[float, float, float]]],
) -> BodyTrack:
    """Feed chunks, each with the goal ahead, to `health`; return their markers."""
    hips = np.concatenate([chunk.translation for chunk, _ in chunks])
    rotations = np.concatenate([chunk.rotations for chunk, _ in chunks])
    goals = np.repeat([goal for _, goal in chunks], NEW_FRAMES, axis=0)
    track = skin_track(bodies[spec.gender], np.array(spec.betas), hips, rotations)
    health.watch(track, rotations[:, 0], distances(hips, goals) <= SPIN_RANGE)
    return track


def _next_goal(world: World, agent: str, random: np.random.Generator) -> Goal:
    x, y, _ = world.get_agent(agent).position
    while True:
        angle, distance = random.uniform(0, tau), random.uniform(*DISTANCE)
        there = (x + distance * np.cos(angle), y + distance * np.sin(angle))
        # an agent outside the range may take any goal nearer to the origin than itself
        if hypot(*there) < max(RANGE, hypot(x, y)):
            return Goal((float(there[0]), float(there[1]), 0.0))
