"""A batch of standing bodies that should walk: real inputs of the shipped model."""

import numpy as np

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.engines.engine import StepInputs, no_obstacles
from wayfarer.models.bundle import START_POSES
from wayfarer.spec import BETAS, GENDERS, LATENT, MANNER
from wayfarer.terms import WALK, weights
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.spawn import Spawner, load_start_poses


def standing_inputs(gender: str, agents: int, candidates: int = 1, seed: int = 1) -> StepInputs:
    """`agents` bodies of random shapes at random places, their goals ahead and aside."""
    random = np.random.default_rng(seed)
    spawner = Spawner(
        {g: load_body(SHIPPED, g, "low") for g in GENDERS}, load_start_poses(START_POSES)
    )
    betas = random.normal(size=(agents, BETAS)).astype(np.float32)
    seeds = [
        spawner.stand(
            AgentSpec(
                gender=gender,
                betas=tuple(betas[i].tolist()),
                position=tuple(random.uniform(-5, 5, 2)),
                noise_seed=i + 1,
            )
        ).seed
        for i in range(agents)
    ]
    floats = np.float32
    return StepInputs(
        seed_markers=np.concatenate([s.markers for s in seeds]),
        seed_translation=np.concatenate([s.translation for s in seeds]),
        seed_rotations=np.concatenate([s.rotations for s in seeds]),
        betas=betas,
        goal=random.uniform(-5, 5, (agents, 3)).astype(floats) * np.array([1, 1, 0], floats),
        target_speed=random.uniform(0.5, 1.5, agents).astype(floats),
        facing=np.zeros((agents, 2), floats),
        term_weights=np.tile(np.array(weights(WALK), floats), (agents, 1)),
        policy=np.ones(agents, floats),
        noise=random.normal(size=(agents, candidates, LATENT)).astype(floats),
        manner=random.normal(size=(agents, MANNER)).astype(floats),
        obstacles=no_obstacles(agents),
    )
