"""What the runtime costs beside the engine: CPU time of each part per 0.2 s of real time.

    python benchmarks/runtime_overhead.py [agents ...]

The engine is replaced by one that returns at once; the agents walk back and forth.
"""

import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.runtime.agent import AgentSpec, Goal, SessionSpec
from wayfarer.runtime.engines.engine import StepInputs, StepOutputs
from wayfarer.runtime.settings import Limits, WorldSettings
from wayfarer.runtime.stepping import batch, scheduler
from wayfarer.runtime.stepping.playback import Playback
from wayfarer.runtime.world.steering import Steering
from wayfarer.runtime.world.world import World
from wayfarer.spec import GENDERS, NEW_FRAMES, SEED_FRAMES, STEP_SECONDS
from wayfarer.terms import TERMS

STEPS = 25


class InstantEngine:
    """Moves everybody one way without computing anything."""

    name = "fake"
    graphs = ("0" * 64, "1" * 64)
    term_names = TERMS

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """See `Engine`."""
        agents = len(inputs.goal)
        move = np.linspace(0, 0.2, NEW_FRAMES + 1, dtype=np.float32)[None, 1:, None]
        return StepOutputs(
            translation=inputs.seed_translation[:, -1:] + move,
            rotations=np.repeat(inputs.seed_rotations[:, -1:], NEW_FRAMES, axis=1),
            contacts=np.ones((agents, NEW_FRAMES, 2), np.float32),
            next_seed_markers=inputs.seed_markers + move[:, -SEED_FRAMES:, None],
            terms=np.zeros((agents, len(TERMS)), np.float32),
            choice=np.zeros(agents, np.int64),
        )


class Clocked:
    """Sums the CPU time spent in named functions, inner ones included."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()

    def wrap(self, owner: Any, attribute: str, name: str) -> None:
        """Time every call of `owner.attribute` from now on."""
        call: Callable[..., Any] = getattr(owner, attribute)

        def timed(*args: Any, **kwargs: Any) -> Any:
            started = time.thread_time()
            try:
                return call(*args, **kwargs)
            finally:
                self.seconds[name] += time.thread_time() - started

        setattr(owner, attribute, timed)


def run(agents: int, clocked: Clocked) -> float:
    """Step a crowd for STEPS × 0.2 s; return CPU milliseconds per 0.2 s, all told."""
    bodies = {gender: load_body("anny52", gender, "low") for gender in GENDERS}
    poses = np.zeros((1, 22, 4), np.float32)
    poses[..., 3] = 1
    limits = Limits(agents=agents, agents_per_session=agents, goal_distance=10_000)
    world = World(InstantEngine(), bodies, poses, WorldSettings(limits))
    world.create_session(SessionSpec("s"), 0.0)
    specs = [AgentSpec(GENDERS[i % 2], noise_seed=i) for i in range(agents)]
    started = time.thread_time()
    infos = world.create_agents("s", specs, 0.0)
    spawn = (time.thread_time() - started) / agents
    for info in infos:
        world.set_goal(info.agent_id, Goal((1000.0, 0.0, 0.0)), 0.0)
    list(world.advance(1.0))
    clocked.seconds.clear()
    started = time.thread_time()
    chunks = sum(1 for _ in world.advance(1.0 + STEPS * STEP_SECONDS))
    seconds = time.thread_time() - started
    assert chunks == agents * STEPS, (chunks, agents * STEPS)
    print(f"{agents} agents: {spawn * 1e3:.2f} ms to make one")
    return seconds / STEPS * 1e3


def main() -> None:
    """Print a table for each number of agents."""
    clocked = Clocked()
    for owner, attribute, name in (
        (Steering, "decide", "decide"),
        (batch, "latents", "noise"),
        (scheduler, "gather", "gather, noise included"),
        (scheduler, "pad", "pad"),
        (InstantEngine, "step", "engine (a stand-in)"),
        (scheduler.Scheduler, "schedule", "schedule, all the above included"),
        (scheduler.Scheduler, "apply", "apply"),
        (Playback, "send", "take out what is due"),
        (World, "collect", "collect, that included"),
        (World, "next_event", "find the next event"),
    ):
        clocked.wrap(owner, attribute, name)
    for agents in [int(a) for a in sys.argv[1:]] or [64, 256, 1000]:
        total = run(agents, clocked)
        print(f"{'total':36s}{total:8.2f} ms per 0.2 s, {total / agents * 1e3:.0f} µs per agent")
        for name, seconds in clocked.seconds.items():
            print(f"  {name:34s}{seconds / STEPS * 1e3:8.2f} ms")


if __name__ == "__main__":
    main()
