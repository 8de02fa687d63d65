"""Gathers slots for one engine call."""

import numpy as np

from wayfarer.engines.engine import Float, StepInputs, no_obstacles
from wayfarer.world.agents.goal import GoalColumns
from wayfarer.world.agents.slots import Gait, Seeds, Slots
from wayfarer.world.agents.style import Style
from wayfarer.world.goals.steering import Steering
from wayfarer.world.rows import Index
from wayfarer.world.stepping.noise import latents


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
    noise = latents(slots.noise_seed[rows], slots.planned_chunks[rows], candidates)
    style = slots.style.take(rows)
    return assemble(seed, slots.betas[rows], gait, goals, noise, style, steering, obstacles)


def assemble(
    seed: Seeds,
    betas: Float,
    gait: Gait,
    goals: GoalColumns,
    noise: Float,
    style: Style,
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
        noise=steering.noise(gait.mode, noise, style.own_noise),
        manner=style.manner,
        obstacles=no_obstacles(len(betas)) if obstacles is None else obstacles,
    )
