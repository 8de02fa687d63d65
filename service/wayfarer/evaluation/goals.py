"""Seeded runs to goals, through the world that serves: all agents at once, on their own clock."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import cos, pi, sin, tau
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.evaluation.outcome import STAND_SECONDS, STEP_LIMIT, Outcome, judge
from wayfarer.evaluation.tracks import Track, skin_track
from wayfarer.runtime.agent import AgentSpec, AgentState, Goal, MotionChunk
from wayfarer.runtime.slots import Motion
from wayfarer.runtime.world import World
from wayfarer.spec import BETAS, FPS, GENDERS, NEW_FRAMES, STEP_SECONDS
from wayfarer.stage import Bodies

Array = NDArray[np.floating[Any]]
Watch = Callable[[float, float], None]
"""Told how many seconds of motion are done, of how many."""

MAX_BETA = 2.0
DISTANCE = (3.0, 8.0)
LEAD_IN = 2.0
"""Seconds of standing, or of walking, before the goal is given."""

SLACK = 10.0
"""Seconds after the 60 primitives in which a late stand can still begin."""


@dataclass(frozen=True)
class Run:
    """One agent's way to one goal: its frames from the first that was made for the goal."""

    spec: AgentSpec
    outcome: Outcome
    track: Track


def random_specs(count: int, random: np.random.Generator) -> list[AgentSpec]:
    """Agents of both genders in turn, random shapes and headings, 10 m apart."""
    side = int(np.ceil(np.sqrt(count)))
    return [
        AgentSpec(
            gender=GENDERS[i % len(GENDERS)],
            betas=tuple(random.uniform(-MAX_BETA, MAX_BETA, BETAS).tolist()),
            position=(10.0 * (i % side), 10.0 * (i // side)),
            heading=float(random.uniform(-pi, pi)),
            noise_seed=int(random.integers(2**63)),
        )
        for i in range(count)
    ]


def run_goals(
    world: World,
    bodies: Bodies,
    specs: Sequence[AgentSpec],
    random: np.random.Generator,
    *,
    walking: bool = False,
    seeds: Sequence[Motion] | None = None,
    watch: Watch = lambda done, total: None,
) -> list[Run]:
    """Send every agent to one goal, 3 … 8 m away in a random direction, and watch it stand.

    The goal comes after 2 s of standing; with `walking`, after 2 s on the way straight ahead;
    with `seeds`, at once: agents then begin in these motions.
    """
    session = world.create_session(None, 0.0).session_id
    agents = world.create_agents(session, specs, 0.0, seeds)
    start = 0.0
    if seeds is None:
        start = LEAD_IN
        if walking:
            for agent, spec in zip(agents, specs, strict=True):
                world.set_goal(agent.agent_id, Goal(_ahead(spec, 20.0)), 0.0)
        for _ in world.advance(start):
            pass

    goals, revisions = {}, {}
    chunks: dict[str, list[MotionChunk]] = {agent.agent_id: [] for agent in agents}
    for agent in agents:
        x, y, _ = world.get_agent(agent.agent_id).position
        angle, distance = random.uniform(0, tau), random.uniform(*DISTANCE)
        goals[agent.agent_id] = np.array(
            [x + distance * cos(angle), y + distance * sin(angle), 0.0]
        )
        goal = Goal(tuple(goals[agent.agent_id].tolist()))
        revisions[agent.agent_id] = world.set_goal(agent.agent_id, goal, start)
    total = start + STEP_LIMIT * STEP_SECONDS + SLACK + STAND_SECONDS
    for chunk in world.advance(total):
        if chunk.goal_revision == revisions[chunk.agent_id]:
            chunks[chunk.agent_id].append(chunk)
        watch(chunk.scheduled_at, total)
    world.delete_session(session)
    return [
        _finish(
            spec,
            bodies[spec.gender],
            chunks[agent.agent_id],
            goals[agent.agent_id],
        )
        for agent, spec in zip(agents, specs, strict=True)
    ]


def _finish(spec: AgentSpec, body: BodyModel, chunks: list[MotionChunk], goal: Array) -> Run:
    hips = np.concatenate([c.translation for c in chunks])
    rotations = np.concatenate([c.rotations for c in chunks])
    standing = np.repeat([c.state == AgentState.STANDING for c in chunks], NEW_FRAMES)
    outcome = judge(hips, standing, goal)
    last = outcome.walking().stop
    if outcome.stopped is not None:
        last = outcome.stopped + STAND_SECONDS * FPS
    track = skin_track(body, np.array(spec.betas), hips[:last], rotations[:last])
    return Run(spec, outcome, track)


def _ahead(spec: AgentSpec, metres: float) -> tuple[float, float, float]:
    x, y = spec.position
    return (x - metres * sin(spec.heading), y + metres * cos(spec.heading), 0.0)
