"""The motions of the paper's pictures, by the shipped model."""

import numpy as np

from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer_lab.evaluation.model_parts import load_parts
from wayfarer_lab.evaluation.outcome import REACHED
from wayfarer_lab.evaluation.paper.motion import EVERY, SHOWN, _walk, seeded_primitives


def test_six_primitives_differ_from_one_seed() -> None:
    rows = seeded_primitives(load_parts(DEFAULT_MODEL, threads=1), seed=3)
    assert [row["name"] for row in rows] == ["ro-1f", "ro-2f"]
    one, two = (np.array(row["seed"]) for row in rows)
    assert one.shape == (1, 22, 3)
    np.testing.assert_array_equal(two[1:], one)  # the longer seed ends with the shorter one
    for row in rows:
        ends = np.array(row["ends"])
        assert ends.shape == (SHOWN, 22, 3)
        assert 0.02 < np.linalg.norm(ends - ends.mean(0), axis=-1).mean() < 0.5
        moved = np.linalg.norm(ends[:, 0] - one[0, 0], axis=-1)
        assert (moved < 0.6).all()  # hips in a fifth of a second


def test_a_walk_is_cut_where_it_reaches_its_goal() -> None:
    joints = np.zeros((200, 22, 3))
    joints[..., 1] = np.arange(200)[:, None] * 0.03
    walk = _walk("x", joints, np.array([0.0, 4.0]))
    hips = np.array(walk["joints"])[:, 0, 1]
    assert walk["reached"]
    assert 4 - REACHED <= hips[-1] <= 4 - REACHED + 0.03
    np.testing.assert_allclose(np.diff(hips[:-1]), EVERY * 0.03)
    far = _walk("x", joints, np.array([0.0, 40.0]))
    assert not far["reached"]
    assert np.array(far["joints"])[-1, 0, 1] == round(199 * 0.03, 3)
