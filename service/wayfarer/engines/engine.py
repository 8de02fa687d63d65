"""The scheduler's interface to the models: steps of agents, as arrays.

All positions are world space: metres, right-handed, Z up. Rotations are unit
quaternions x, y, z, w; joint 0 (the hips) is a world rotation, joints 1..21 are local to
their parent and relative to the T-pose, whose bones all have identity rotation.
A = agents, K = candidates, S = seed frames (2), F = new frames (8), T = quality terms.
"""

from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import OBSTACLES

Float = NDArray[np.float32]

EngineKind = Literal["auto", "onnxruntime", "openvino", "torch"]
"""Which engine to open; "auto": the faster of the first two on this machine."""


@dataclass(frozen=True, slots=True)
class StepInputs:
    """Inputs of one batched step; the field names are the graph's input names."""

    seed_markers: Float  # [A, S, 67, 3]
    seed_translation: Float  # [A, S, 3] hips joint
    seed_rotations: Float  # [A, S, 22, 4]
    betas: Float  # [A, 10]
    goal: Float  # [A, 3] point on the floor
    target_speed: Float  # [A] metres per second, horizontal
    facing: Float  # [A, 2] world, unit vector the body should face; (0, 0): the way to the goal
    term_weights: Float  # [A, T] cost = sum of weight * term; lower is better
    policy: Float  # [A] 0 … 1, share of the policy in the latents: 0 is the prior N(0, I)
    noise: Float  # [A, K, 128] standard normal, already scaled by temperature
    manner: Float  # [A, 8] standard normal, fixed for each agent
    # [A, O, 7] what is near, seen from above: a line from a to b with a radius, moving evenly:
    # ax, ay, bx, by, vx, vy, radius (metres, m/s); a radius below 0 is none
    obstacles: Float


@dataclass(frozen=True, slots=True)
class StepOutputs:
    """Outputs of one batched step, for the cheapest candidate of each agent."""

    translation: Float  # [A, F, 3] hips joint
    rotations: Float  # [A, F, 22, 4]
    contacts: Float  # [A, F, 2] left, right foot: 1.0 touching and still, otherwise 0.0
    next_seed_markers: Float  # [A, S, 67, 3]; "next": a graph's names must all differ
    terms: Float  # [A, T] quality terms of the chosen candidate; see `Engine.scoring`
    choice: NDArray[np.int64]  # [A]


LEFT_OUT = ("terms", "choice")
"""Outputs of a step that nothing has to choose from."""


def unscored(rows: int) -> dict[str, NDArray[Any]]:
    """Values for the outputs in `LEFT_OUT`."""
    return {"terms": np.zeros((rows, 0), np.float32), "choice": np.zeros(rows, np.int64)}


def no_obstacles(agents: int) -> Float:
    """`StepInputs.obstacles` of agents with nothing near them."""
    nothing = np.zeros((agents, OBSTACLES, 7), np.float32)
    nothing[..., -1] = -1
    return nothing


class Engine(Protocol):
    """Steps agents of one body. Pure: the same inputs give the same outputs, bit for bit."""

    name: str  # of its model
    graphs: tuple[str, ...]  # SHA-256 of what it runs for each gender, hexadecimal
    term_names: tuple[str, ...]

    @property
    def single_threaded(self) -> "Engine":
        """The same engine on the calling thread only: it leaves the other cores alone."""
        ...

    @property
    def scoring(self) -> "Engine":
        """The same engine, whose `terms` can be relied on.

        Other engines may omit the terms, [A, 0], if there is one candidate: nothing is chosen.
        """
        return self

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        """Steps all rows, which are agents of one gender.

        A row's result depends on that row alone, bit for bit, whatever the others are.
        """
        ...


def variant(kind: str, graph: str) -> str:
    """The SHA-256 of a graph as an engine runs it that gives other last bits than onnxruntime.

    Logs name their engine, and are replayed only with it.
    """
    return sha256(f"{kind} {graph}".encode()).hexdigest()
