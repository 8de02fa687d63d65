"""The first primitive of the paper's protocol, by the shipped 1-frame predictor."""

import numpy as np

from tests.lab.evaluation.people import make_world
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer_lab.evaluation.control import random_pairs
from wayfarer_lab.evaluation.first_primitive import Lead
from wayfarer_lab.evaluation.model_parts import load_parts


def test_a_body_at_rest_ends_its_first_primitive_in_motion() -> None:
    specs = [pair.spec for pair in random_pairs(3, 1.2, np.random.default_rng(0))]
    still = make_world().prepare(specs)
    moved = make_world().prepare(specs)
    Lead(load_parts(DEFAULT_MODEL, threads=1), seed=1)(specs, moved)
    for spec, before, after in zip(specs, still, moved, strict=True):
        assert np.ptp(before.seed.translation, axis=1).max() == 0
        speed = np.diff(after.seed.translation[0], axis=0) * 40
        assert 0.01 < np.linalg.norm(speed) < 3
        assert np.linalg.norm(after.seed.translation[0, -1, :2] - spec.position[:2]) < 0.5
        reach = np.linalg.norm(after.seed.markers[0] - after.seed.translation[0, :, None], axis=-1)
        assert reach.max() < 1.3  # a body, round its hips
        assert not after.gait.rested.any()
