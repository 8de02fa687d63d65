"""Drivers of the bare model, with the shipped networks."""

from functools import cache

import numpy as np
import pytest
import torch

from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.motion.policy import TrajectoryPolicy
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer_lab.evaluation.model_parts import Variant, load_parts
from wayfarer_lab.evaluation.twosided.bare import BareStep, roll
from wayfarer_lab.evaluation.twosided.drivers import led, searched
from wayfarer_lab.evaluation.twosided.wishes import ORDERS

WALK = {"walk 1.2": ORDERS["walk 1.2"]}


@cache
def shipped() -> PrimitiveStep:
    return load_parts(DEFAULT_MODEL, threads=1).step("female", Variant("bare", "ro-2f"))


def walked(step: BareStep, seed: int = 0) -> np.ndarray:
    """Hips [A, T, 3] of two people that should walk."""
    tracks = roll({"female": step}, people=2, seed=seed, orders=WALK)
    return np.stack([track.take.hips for track in tracks])


def test_the_search_goes_where_it_is_wished() -> None:
    hips = walked(searched(shipped(), torch.Generator().manual_seed(0), 16))
    speed = np.linalg.norm(np.diff(hips[:, 200:, :2], axis=1), axis=-1).mean() * 40
    assert speed == pytest.approx(1.2, abs=0.2)
    assert (hips[:, -1, 1] > 8).all() and np.abs(hips[:, -1, 0]).max() < 2


def test_a_policy_is_drawn_from_and_an_untrained_one_is_the_prior() -> None:
    def drawn(seed: int, temperature: float = 1.0) -> np.ndarray:
        random = torch.Generator().manual_seed(seed)
        return walked(led(shipped(), TrajectoryPolicy(16), random, temperature))

    one = drawn(1)
    assert np.array_equal(one, drawn(1)) and not np.array_equal(one, drawn(2))
    assert np.array_equal(drawn(1, 0.0), drawn(2, 0.0)), "its mean knows no chance"
    assert np.isfinite(one).all() and one[..., 2].min() > 0.5
