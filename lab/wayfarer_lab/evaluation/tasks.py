"""Agents that carry out orders in the world that serves, together, faster than real time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import cos, pi, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.clips.clip import Clip
from wayfarer.spec import BETAS, GENDERS, NEW_FRAMES
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, MotionChunk, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.heading import facing_of
from wayfarer.world.goals.commands import Path
from wayfarer.world.world import World
from wayfarer_lab.evaluation.tracks import BodyTrack, skin_track

Array = NDArray[np.floating[Any]]
Watch = Callable[[float, float], None]
"""Called with the seconds of motion done, and their total."""

Plan = Callable[[AgentInfo], Sequence[Goal]]
"""Makes an agent's path from its present state."""

MAX_BETA: Final = 2.0

LEAD_IN: Final = 2.0
"""Seconds of standing before the first order."""

EARLY: Final = 1e-3
"""Seconds by which times of chunks may differ from sums of steps."""

FLOOR: Final = SessionSpec(avoid=False)
"""A session on an endless flat floor, where agents do not see each other."""


@dataclass(frozen=True)
class TimedCommand:
    """A path of one or more goals, and when it is given."""

    at: float  # seconds after the lead-in
    plan: Plan


@dataclass(frozen=True)
class AgentTask:
    """An agent and its orders."""

    spec: AgentSpec
    orders: tuple[TimedCommand, ...]  # in order of time, the first at 0; none: it stands


@dataclass(frozen=True)
class IssuedCommand:
    """An order that was given."""

    path: tuple[Goal, ...]
    frame: int  # the first one made for it


@dataclass(frozen=True)
class Trajectory:
    """The frames sent for an agent, from the first one made for its first order, or without
    orders after the lead-in. World space.
    """

    spec: AgentSpec
    given: tuple[IssuedCommand, ...]
    hips: Array  # [T, 3]
    rotations: Array  # [T, 22, 4] x, y, z, w; joint 0 is the hips' world rotation
    contacts: NDArray[np.bool_]  # [T, 2] left, right

    @cached_property
    def facing(self) -> Array:
        """Horizontal unit vector that the body faces. [T, 2]"""
        return facing_of(self.rotations[:, 0])

    @property
    def goal(self) -> Goal:
        """The last goal of the last order."""
        return self.given[-1].path[-1]

    def latest(self) -> "Trajectory":
        """The part from the first frame made for the last order."""
        frame = self.given[-1].frame
        return replace(
            self,
            given=(replace(self.given[-1], frame=0),),
            hips=self.hips[frame:],
            rotations=self.rotations[frame:],
            contacts=self.contacts[frame:],
        )

    def clip(self) -> Clip:
        """The whole trajectory as a clip, with the goals of its orders."""
        return Clip(
            self.hips,
            self.rotations,
            self.contacts,
            self.spec.gender,
            self.spec.betas,
            goals=tuple(goal.position for given in self.given for goal in given.path),
        )

    def track(self, body: BodyModel, frames: slice = slice(None)) -> BodyTrack:
        """Skinned markers of some of its frames."""
        betas = np.array(self.spec.betas)
        return skin_track(body, betas, self.hips[frames], self.rotations[frames])


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


def relative(agent: AgentInfo, ahead: float, left: float) -> tuple[float, float, float]:
    """The place `ahead` metres ahead of an agent and `left` metres to its left, on the floor."""
    x, y, _ = agent.position
    s, c = sin(agent.heading), cos(agent.heading)
    return (x - ahead * s - left * c, y + ahead * c - left * s, 0.0)


def run_tasks(
    world: World,
    tasks: Sequence[AgentTask],
    seconds: float,
    *,
    session: SessionSpec = FLOOR,
    watch: Watch = lambda done, total: None,
) -> list[Trajectory]:
    """Runs all agents with their orders in one session, for `seconds` from the first order.

    The first order comes after 2 s of standing.
    """
    session_id = world.create_session(session, 0.0).session_id
    specs = [task.spec for task in tasks]
    agents = [a.agent_id for a in world.create_agents(session_id, specs, 0.0)]
    chunks: dict[str, list[MotionChunk]] = {agent: [] for agent in agents}
    idle = {agent for agent, task in zip(agents, tasks, strict=True) if not task.orders}
    given: dict[str, list[tuple[int, tuple[Goal, ...]]]] = {agent: [] for agent in agents}

    def advance(until: float) -> None:
        for chunk in world.advance(until):
            orders = given[chunk.agent_id]
            if chunk.agent_id in idle:
                begun = chunk.scheduled_at >= LEAD_IN - EARLY
            else:
                begun = bool(orders) and chunk.goal_revision >= orders[0][0]
            if begun:
                chunks[chunk.agent_id].append(chunk)
            watch(chunk.scheduled_at, LEAD_IN + seconds)

    for moment in sorted({order.at for task in tasks for order in task.orders}):
        advance(LEAD_IN + moment)
        for agent, task in zip(agents, tasks, strict=True):
            for order in task.orders:
                if order.at == moment:
                    path = tuple(order.plan(world.get_agent(agent)))
                    revision = world.give(agent, Path(tuple(path)), LEAD_IN + moment)
                    given[agent].append((revision, path))
    advance(LEAD_IN + seconds)
    world.delete_session(session_id)
    return [
        _trajectory(task.spec, given[agent], chunks[agent])
        for agent, task in zip(agents, tasks, strict=True)
    ]


def _trajectory(
    spec: AgentSpec, given: Sequence[tuple[int, tuple[Goal, ...]]], chunks: Sequence[MotionChunk]
) -> Trajectory:
    revisions = np.repeat([c.goal_revision for c in chunks], NEW_FRAMES)
    # an order that was replaced before anything made for it was sent is not there
    given = [(revision, path) for revision, path in given if revision <= revisions[-1]]
    return Trajectory(
        spec=spec,
        given=tuple(
            IssuedCommand(path, int(np.argmax(revisions >= revision))) for revision, path in given
        ),
        hips=np.concatenate([c.translation for c in chunks]),
        rotations=np.concatenate([c.rotations for c in chunks]),
        contacts=np.concatenate([c.contacts for c in chunks]),
    )
