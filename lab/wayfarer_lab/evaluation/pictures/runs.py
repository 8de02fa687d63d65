"""Random runs to goals, in the world that serves."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import cos, inf, pi, sin, tau
from typing import Final

import numpy as np

from wayfarer.clips.clip import Clip, join_chunks
from wayfarer.spec import BETAS, FPS, GENDERS, NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.agent import AgentSpec, AgentState, ChunkFlag, MotionChunk, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.world import World

DISTANCE: Final = (2.0, 6.0)
"""Metres to a goal."""

MAX_BETA: Final = 2.0
LEAD_IN: Final = 0.6
"""Seconds of standing before the first goal."""

LINGER: Final = 1.0
"""Seconds of standing at each goal, and at the end of the run."""


@dataclass
class _Runner:
    """One agent while its run is made."""

    spec: AgentSpec
    random: np.random.Generator
    goals: list[Goal] = field(default_factory=list)
    chunks: list[MotionChunk] = field(default_factory=list)
    arrived: bool = False
    stood: float = 0.0  # seconds of standing at the goal

    def next_goal(self, x: float, y: float) -> Goal:
        """A place 2 … 6 m away in any direction."""
        angle, distance = self.random.uniform(0, tau), self.random.uniform(*DISTANCE)
        self.goals.append(Goal((x + distance * cos(angle), y + distance * sin(angle), 0.0)))
        self.arrived, self.stood = False, 0.0
        return self.goals[-1]


def random_runs(
    world: World,
    count: int,
    seed: int,
    stops: int = 1,
    seconds: float = 12.0,
    watch: Callable[[float], None] = lambda done: None,
) -> list[Clip]:
    """People of both genders in turn, of random shape and heading, each sent to `stops` goals.

    Run i depends on `seed` and i alone, not on `count`. A run ends 1 s after the last stand, or
    after so many seconds. `watch` is called with the seconds done.
    """
    frames = round(seconds * FPS)
    runners = [_runner(number, seed) for number in range(count)]
    session = world.create_session(SessionSpec(avoid=False), 0.0).session_id
    agents = world.create_agents(session, [runner.spec for runner in runners], 0.0)
    by_id = {agent.agent_id: runner for agent, runner in zip(agents, runners, strict=True)}
    running = set(by_id)
    for chunk in world.advance(inf):
        runner = by_id[chunk.agent_id]
        if chunk.agent_id not in running:
            continue
        runner.chunks.append(chunk)
        done = len(runner.chunks) * NEW_FRAMES
        watch(min(done / FPS, seconds))
        if not runner.goals:
            ready = done >= LEAD_IN * FPS
        else:
            runner.arrived |= ChunkFlag.ARRIVED in chunk.flags
            stands = runner.arrived and chunk.state == AgentState.STANDING
            runner.stood = runner.stood + STEP_SECONDS if stands else 0.0
            ready = runner.stood >= LINGER
        if ready and len(runner.goals) < stops:
            x, y, _ = chunk.translation[-1].tolist()
            world.give(chunk.agent_id, runner.next_goal(x, y), chunk.scheduled_at)
        elif ready or done >= frames:
            running.discard(chunk.agent_id)
            if not running:
                break
    world.delete_session(session)
    return [_clip(runner)[:frames] for runner in runners]


def _runner(number: int, seed: int) -> _Runner:
    random = np.random.default_rng([seed, number])
    spec = AgentSpec(
        gender=GENDERS[number % len(GENDERS)],
        betas=tuple(random.uniform(-MAX_BETA, MAX_BETA, BETAS).tolist()),
        heading=float(random.uniform(-pi, pi)),
        noise_seed=int(random.integers(2**63)),
    )
    return _Runner(spec, random)


def _clip(runner: _Runner) -> Clip:
    return join_chunks(
        runner.chunks, runner.spec, goals=tuple(goal.position for goal in runner.goals)
    )


def caption(name: str, clip: Clip) -> str:
    """What a clip is, in a line: who, how long, and how near to its last goal it ends."""
    parts = [name, clip.gender, f"{clip.seconds:.1f} s"]
    if clip.goals:
        left = np.linalg.norm(clip.translation[-1, :2] - np.array(clip.goals[-1][:2]))
        parts.append(f"ends {left:.2f} m from its goal")
    return "  ·  ".join(parts)
