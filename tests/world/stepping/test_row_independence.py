"""With the shipped model, a row's result does not depend on its batch, to the bit.

Replay relies on this: when a log is run again, agents have other neighbours in their batches.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.engines.padding import pad
from wayfarer.models.bundle import DEFAULT_MODEL, START_POSES, open_bundle
from wayfarer.world.agents.agent import AgentSpec, MotionChunk, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

SECONDS = 3.05


@dataclass
class Recorder:
    """An engine that remembers its inputs."""

    engine: object
    name: str = "recorder"
    graphs: tuple[str, ...] = ()

    def __post_init__(self):
        self.calls: list[tuple[str, StepInputs]] = []

    def step(self, gender, inputs):
        self.calls.append((gender, inputs))
        return self.engine.step(gender, inputs)


@pytest.fixture(scope="module")
def stages():
    """Engine stages by number of threads."""
    return {threads: open_bundle(DEFAULT_MODEL, threads) for threads in (1, 2, 3)}


def person(number: int) -> AgentSpec:
    rng = np.random.default_rng(number)
    return AgentSpec(
        gender=("female", "male")[number % 3 == 0],
        betas=tuple(rng.normal(size=10) * 0.7),
        position=(float(number), rng.normal()),
        heading=float(number),
        noise_seed=number,
    )


def walk(bundle, people: list[AgentSpec], settings: WorldSettings) -> dict[int, list[MotionChunk]]:
    """Chunks by noise seed; each agent walks to its own goal."""
    world = World(bundle.engine, bundle.bodies, load_start_poses(START_POSES), settings)
    world.create_session(SessionSpec("s"), 0.0)
    seeds = {}
    for agent in world.create_agents("s", people, 0.0):
        seed = seeds[agent.agent_id] = agent.spec.noise_seed
        x, y = agent.spec.position
        goal = Goal((x + 2 * np.sin(seed), y + 2.0, 0.0), speed=0.8 + 0.1 * (seed % 7), heading=1.0)
        world.give(agent.agent_id, goal, 0.0)
    chunks: dict[int, list[MotionChunk]] = {}
    for chunk in world.advance(SECONDS):
        chunks.setdefault(seeds[chunk.agent_id], []).append(chunk)
    return chunks


def settings(*batch_sizes: int, candidates: int = 2) -> WorldSettings:
    steering = Steering().with_search(candidates=candidates)
    return WorldSettings(steering=steering, phases=1, batch_sizes=batch_sizes)


@pytest.fixture(scope="module")
def recorded(stages):
    """Inputs by gender, of 8 and more people in the middle of a walk."""
    recorder = Recorder(stages[1].engine)
    people = [person(number) for number in range(30)]
    walk(replace(stages[1], engine=recorder), people, settings(32, candidates=4))
    return dict(recorder.calls[-8:])


def take(inputs: StepInputs, rows, candidates: int) -> StepInputs:
    taken = {f.name: getattr(inputs, f.name)[rows] for f in fields(StepInputs)}
    return StepInputs(**{**taken, "noise": np.ascontiguousarray(taken["noise"][:, :candidates])})


def same(a: StepOutputs, row: int, b: StepOutputs, other: int) -> bool:
    return all(
        np.array_equal(getattr(a, f.name)[row], getattr(b, f.name)[other])
        for f in fields(StepOutputs)
    )


@pytest.mark.parametrize("gender", ["female", "male"])
@pytest.mark.parametrize("candidates", [1, 2, 4])
def test_a_row_is_the_same_in_every_batch(stages, recorded, gender, candidates):
    inputs, rng = recorded[gender], np.random.default_rng(1)
    alone = [stages[1].engine.step(gender, take(inputs, [row], candidates)) for row in range(8)]
    for threads, bundle in stages.items():
        for size in (1, 2, 3, 5, 7, 8, 31, *((64, 513) if candidates == 1 else ())):
            rows = rng.integers(0, 8, size)
            batch = pad(take(inputs, rows, candidates), (1, 2, 4, 8, 64))
            outputs = bundle.engine.step(gender, batch)
            for place, row in enumerate(rows):
                assert same(outputs, place, alone[row], 0), (threads, size, place)


def test_an_agents_motion_is_its_own_from_goal_to_locked_feet(stages):
    me = person(100)
    alone = walk(stages[1], [me], settings(1))[100]
    crowd = [person(number) for number in range(12)]
    for threads, people, sizes in (
        (2, [me, *crowd], tuple(range(1, 9))),
        (3, [*crowd, me], (3, 16)),
    ):
        among = walk(stages[threads], people, settings(*sizes))[100]
        assert len(among) == len(alone) > 10
        for a, b in zip(alone, among, strict=True):
            for name in ("translation", "rotations", "contacts"):
                np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
            assert (a.seq, a.flags, a.state) == (b.seq, b.flags, b.state)
