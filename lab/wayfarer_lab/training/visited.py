"""What networks are asked while they serve: the inputs of all steps of a crowd that is sent about.

Distillation (`distillation.py`) needs the questions alone: the networks to be copied answer them.
Recorded motion asks others: no seed in it has been planted, righted or mirrored.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from math import pi, tau
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from wayfarer.engines.engine import Engine, StepInputs, StepOutputs
from wayfarer.errors import ArtifactError
from wayfarer.model_bundle import ModelBundle, open_bundle
from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.policy import Condition
from wayfarer.spec import BETAS, GENDERS, SEED_FRAMES
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering
from wayfarer_lab.training.rotation import matrix_from_quaternion

DISTANCES = (0.3, 8.0)
"""Metres to the next goal."""

SPEEDS = (0.4, 3.0)
"""Metres per second; squared, so that most walk."""

PATIENCE = (0.5, 10.0)
"""Seconds until the next command, whatever has become of the last."""

FACES, STRAFES, PASSES, STANDS = 0.35, 0.2, 0.2, 0.2
"""Shares of goals with a heading, to which one walks facing it, which are passed through, and at
which an agent stands already."""

CANDIDATES = {1: 0.75, 4: 0.25}
"""Shares of the time with so many candidates: the policy alone, and the search of the service."""

FIRST = 2.0
"""Seconds within which everybody gets the first command."""


@dataclass(frozen=True)
class Visited:
    """N questions, in the canonical frame of their seed."""

    seed: Tensor  # [N, 2, 201]
    goal: Tensor  # [N, 3]
    target_speed: Tensor  # [N]
    facing: Tensor  # [N, 2]
    term_weights: Tensor  # [N, T]
    share: Tensor  # [N] of the policy in the latents
    manner: Tensor  # [N, 128] what is added to all noise

    def __len__(self) -> int:
        return len(self.share)

    def __getitem__(self, rows: Tensor | slice) -> "Visited":
        return Visited(*(getattr(self, column.name)[rows] for column in fields(self)))

    @property
    def condition(self) -> Condition:
        """What the policy is asked."""
        return Condition(self.goal, self.target_speed, self.facing, self.term_weights)

    @staticmethod
    def joined(parts: Sequence["Visited"]) -> "Visited":
        """All of them."""
        columns = (column.name for column in fields(Visited))
        return Visited(*(torch.cat([getattr(part, name) for part in parts]) for name in columns))

    @staticmethod
    def of(inputs: StepInputs, floor_origin: bool) -> "Visited":
        """The questions of one step."""
        told = {f.name: torch.from_numpy(getattr(inputs, f.name)) for f in fields(inputs)}
        root = matrix_from_quaternion(told["seed_rotations"][:, 0, 0])
        frame = canonical_frame(told["seed_translation"][:, 0], root, floor_origin)
        markers = to_local(frame, told["seed_markers"].flatten(1, 2))
        return Visited(
            seed=markers.unflatten(1, (SEED_FRAMES, -1)).flatten(2),
            goal=to_local(frame, told["goal"][:, None])[:, 0],
            target_speed=told["target_speed"].clone(),
            facing=(told["facing"][:, None] @ frame.rotation[:, :2, :2])[:, 0],
            term_weights=told["term_weights"].clone(),
            share=told["policy"].clone(),
            manner=told["noise"][:, 0].clone(),
        )

    def save(self, path: Path) -> None:
        """Write it as one file."""
        torch.save({c.name: getattr(self, c.name) for c in fields(self)}, path)

    @staticmethod
    def load(path: Path) -> "Visited":
        """Raises ArtifactError when it cannot be read."""
        if not path.exists():
            raise ArtifactError(f"no {path}; make it first: wayfarer train visit {path.parent}")
        return Visited(**torch.load(path, weights_only=True))


FILES = ("train.pt", "validation.pt")
"""Of a folder of questions."""


def load_visited(folder: Path) -> tuple[Visited, Visited]:
    """Questions of training and of validation, of other people. Raises ArtifactError."""
    train, validation = (Visited.load(folder / file) for file in FILES)
    return train, validation


def write_visited(
    models: Path,
    folder: Path,
    agents: int,
    seconds: float,
    seed: int,
    watch: Callable[[float, float], None],
) -> tuple[int, int]:
    """Write a folder of questions; returns how many are of training and of validation.

    `watch` hears the seconds done and their total. For validation a quarter of the agents walk for
    a quarter of the time. Raises ArtifactError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    stints = [(agents, share * seconds, count) for count, share in CANDIDATES.items()]
    stints.append((max(1, agents // 4), seconds / 4, min(CANDIDATES)))
    total, done = sum(stint[1] for stint in stints), 0.0
    found = []

    def hear(now: float) -> None:
        watch(done + now, total)

    for number, (people, length, candidates) in enumerate(stints):
        found.append(visit(models, people, length, candidates, seed + number, hear))
        done += length
    parts = (Visited.joined(found[:-1]), found[-1])
    for part, file in zip(parts, FILES, strict=True):
        part.save(folder / file)
    return len(parts[0]), len(parts[1])


class _Heard:
    """An engine whose inputs are passed on to `hear`."""

    def __init__(self, engine: Engine, hear: Callable[[StepInputs], None]) -> None:
        self._engine, self._hear = engine, hear

    def __getattr__(self, name: str) -> Any:
        return getattr(self._engine, name)

    @property
    def single_threaded(self) -> "_Heard":
        return self

    @property
    def scoring(self) -> "_Heard":
        return self

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        self._hear(inputs)
        return self._engine.step(gender, inputs)


def visit(
    models: Path,
    agents: int,
    seconds: float,
    candidates: int,
    seed: int,
    watch: Callable[[float], None] = lambda seconds: None,
) -> Visited:
    """What a model folder is asked while `agents` random people get random commands for `seconds`.

    `watch` hears how many seconds of motion are done. Raises ArtifactError.
    """
    bundle = open_bundle(models, threads=0)
    floor = bundle.models.contracts["predictor_2f.onnx"].floor_origin
    parts: list[Visited] = []
    heard: Any = _Heard(bundle.engine, lambda inputs: parts.append(Visited.of(inputs, floor)))
    _send_about(replace(bundle, engine=heard), agents, seconds, candidates, seed, watch)
    return Visited.joined(parts)


def _send_about(
    bundle: ModelBundle,
    agents: int,
    seconds: float,
    candidates: int,
    seed: int,
    watch: Callable[[float], None],
) -> None:
    random = np.random.default_rng(seed)
    world = bundle.world(agents, Steering().with_search(candidates=candidates))
    session = world.create_session(SessionSpec(avoid=False), 0.0).session_id
    specs = [
        AgentSpec(
            gender=GENDERS[number % len(GENDERS)],
            betas=tuple(map(float, random.standard_normal(BETAS).clip(-2.5, 2.5))),
            position=(3.0 * (number % 32), 3.0 * (number // 32)),
            heading=float(random.uniform(-pi, pi)),
            noise_seed=int(random.integers(2**32)),
        )
        for number in range(agents)
    ]
    made = [agent.agent_id for agent in world.create_agents(session, specs, 0.0)]
    again = {agent: float(random.uniform(0.0, FIRST)) for agent in made}
    for chunk in world.advance(seconds):
        now = chunk.scheduled_at
        if now < again[chunk.agent_id]:
            continue
        world.give(chunk.agent_id, command(world.get_agent(chunk.agent_id), random), now)
        again[chunk.agent_id] = now + float(random.uniform(*PATIENCE))
        watch(now)


def command(agent: AgentInfo, random: np.random.Generator) -> Goal:
    """Somewhere else, or where the agent is, in any of the ways in which a goal can be given."""
    x, y, _ = agent.position
    angle, distance = random.uniform(0, tau), random.uniform(*DISTANCES)
    if random.random() < STANDS:
        distance = 0.0
    low, high = SPEEDS
    kind = random.random()
    strafes, passes = kind < STRAFES, kind > 1 - PASSES
    faces = strafes or (not passes and random.random() < FACES)
    return Goal(
        (float(x + distance * np.cos(angle)), float(y + distance * np.sin(angle)), 0.0),
        speed=float(low + (high - low) * random.random() ** 2),
        heading=float(random.uniform(-pi, pi)) if faces else None,
        stop=not passes,
        strafe=bool(strafes),
    )
