"""Inputs of the right shapes and of no meaning, for warm-up, choice of engine and benchmarks."""

import numpy as np

from wayfarer.engines.engine import StepInputs, no_obstacles
from wayfarer.spec import BETAS, LATENT, MANNER, MARKERS, POSED_JOINTS, SEED_FRAMES
from wayfarer.terms import TERMS


def dummy_inputs(agents: int, candidates: int) -> StepInputs:
    """Inputs of a batch: `agents` rows, `candidates` each."""
    rotations = np.zeros((agents, SEED_FRAMES, POSED_JOINTS, 4), np.float32)
    rotations[..., 3] = 1.0
    return StepInputs(
        seed_markers=np.zeros((agents, SEED_FRAMES, MARKERS, 3), np.float32),
        seed_translation=np.zeros((agents, SEED_FRAMES, 3), np.float32),
        seed_rotations=rotations,
        betas=np.zeros((agents, BETAS), np.float32),
        goal=np.zeros((agents, 3), np.float32),
        target_speed=np.zeros(agents, np.float32),
        facing=np.zeros((agents, 2), np.float32),
        term_weights=np.zeros((agents, len(TERMS)), np.float32),
        policy=np.zeros(agents, np.float32),
        noise=np.zeros((agents, candidates, LATENT), np.float32),
        manner=np.zeros((agents, MANNER), np.float32),
        obstacles=no_obstacles(agents),
    )
