"""Capsules measured on the shipped bodies."""

import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation.scenes.bodies import Form, pose


def form(gender: str = "male", beta: float = 0.0) -> Form:
    return Form(load_body("anny52", gender, "low"), np.eye(10)[0] * beta)


@pytest.mark.parametrize("gender", GENDERS)
def test_capsules_lie_within_the_skin_and_fill_it(gender: str) -> None:
    made = form(gender)
    turns = np.tile(np.eye(3), (1, len(made.rest), 1, 1))
    still = np.zeros((1, 22, 4))
    still[..., 3] = 1
    posed = pose([made], np.zeros(1, int), made.rest[None, 0], still)
    assert np.allclose(posed.turns, turns) and np.allclose(posed.places[0], made.rest)
    skin = made.skin(posed.turns, posed.places)[0]
    a, b = posed.start[0][:, None], posed.end[0][:, None]
    along = b - a
    share = ((skin - a) * along).sum(-1) / np.maximum((along * along).sum(-1), 1e-12)
    away = np.linalg.norm(skin - a - np.clip(share, 0, 1)[..., None] * along, axis=-1)
    outside = (away - posed.radii[0][:, None]).min(0)  # of each vertex, to the nearest capsule
    assert np.quantile(outside, 0.95) < 0.07, "no part of the body is without one"
    assert 0.2 < (outside < 0).mean() < 0.8, "about half of the skin is inside"


def test_a_larger_body_has_larger_capsules() -> None:
    small, large = form(beta=-3.0).capsules.radii, form(beta=3.0).capsules.radii
    assert not np.allclose(small, large)


def test_each_row_has_the_shape_of_its_own_agent() -> None:
    forms = [form(beta=-2.0), form(beta=2.0)]
    still = np.zeros((3, 22, 4))
    still[..., 3] = 1
    who = np.array([1, 0, 1])
    posed = pose(forms, who, np.zeros((3, 3)), still)
    alone = pose(forms, who[1:2], np.zeros((1, 3)), still[:1])
    assert np.allclose(posed.places[1], alone.places[0])
    assert np.allclose(posed.places[0], posed.places[2])
    assert not np.allclose(posed.places[0], posed.places[1])
    assert np.allclose(posed.radii[0], forms[1].capsules.radii)
