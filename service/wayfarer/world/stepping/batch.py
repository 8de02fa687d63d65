"""Gathers slots for one engine call, puts the results back, and finds broken rows."""

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from wayfarer.engines.engine import Float, StepInputs, StepOutputs, no_obstacles
from wayfarer.process.compiled import compiled, inner, warm
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Seeds, Slots
from wayfarer.world.agents.style import manner, own_noise
from wayfarer.world.goals.steering import Steering
from wayfarer.world.output.legs import packed
from wayfarer.world.rows import Flags, Index
from wayfarer.world.stepping.noise import latents

MAX_STEP_METRES = 3.0
"""A body that moves farther in one step (15 m/s) has exploded."""


def gather(
    slots: Slots,
    rows: Index,
    seed: Seeds,
    gait: Gait,
    goals: GoalColumns,
    candidates: int,
    steering: Steering,
    obstacles: Float,
) -> StepInputs:
    """Engine inputs of `rows`; `seed`, the next gait and the goals are those of the rows."""
    seeds, chunks = slots.noise_seed[rows], slots.planned_chunks[rows]
    noise = latents(seeds, chunks, candidates)
    return assemble(seed, slots.betas[rows], gait, goals, noise, seeds, steering, obstacles)


def assemble(
    seed: Seeds,
    betas: Float,
    gait: Gait,
    goals: GoalColumns,
    noise: Float,
    noise_seed: NDArray[np.uint64],
    steering: Steering,
    obstacles: Float | None = None,
) -> StepInputs:
    """Engine inputs of the step with gait `gait`: betas [A, 10], noise [A, K, 128] ~ N(0, I)."""
    target = steering.targets(gait, seed, goals)
    place = np.zeros((len(betas), 3), np.float32)  # the floor, as in training: height 0
    place[:, :2] = target.place
    return StepInputs(
        seed_markers=seed.markers,
        seed_translation=seed.translation,
        seed_rotations=seed.rotations,
        betas=betas,
        goal=place,
        target_speed=target.speed,
        facing=target.facing,
        term_weights=steering.term_weights(gait.mode),
        policy=steering.policy(gait.mode),
        noise=steering.noise(gait.mode, noise, own_noise(noise_seed)),
        manner=manner(noise_seed),
        obstacles=no_obstacles(len(betas)) if obstacles is None else obstacles,
    )


def broken(start: Float, outputs: StepOutputs) -> NDArray[np.bool_]:
    """Rows [A] that cannot be shown: not finite, or with hips far off `start` [A, 3]."""
    found, rows = np.empty(len(start), np.bool_), len(start)
    turns, markers = (
        packed(values).reshape(rows, math.prod(values.shape[1:]))
        for values in (outputs.rotations, outputs.next_seed_markers)
    )
    _break(packed(start), packed(outputs.translation), turns, markers, found)
    return found


@compiled
def _break(start: Float, translation: Float, turns: Float, markers: Float, found: Flags) -> None:
    """Finds broken rows from hips [A, F, 3] and the other numbers of each row [A, N]."""
    for row in range(len(found)):
        whole = _finite(turns, row) and _finite(markers, row)
        for frame in range(translation.shape[1]):
            x = translation[row, frame, 0] - start[row, 0]
            y = translation[row, frame, 1] - start[row, 1]
            z = translation[row, frame, 2] - start[row, 2]
            whole = whole and math.sqrt(x * x + y * y + z * z) <= MAX_STEP_METRES
        found[row] = not whole


@inner
def _finite(values: Float, row: int) -> bool:
    whole = True
    for k in range(values.shape[1]):
        whole &= abs(values[row, k]) < np.inf
    return whole


@cache
def prepare() -> None:
    """Compiles the check, or loads it, before agents walk."""
    row = np.zeros((1, 3), np.float32)
    warm(_break, row, row[None], row, row, np.ones(1, np.bool_))
