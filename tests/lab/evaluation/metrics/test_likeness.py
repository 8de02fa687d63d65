"""Two samples that are alike, and two that are not."""

import numpy as np
import pytest

from wayfarer_lab.evaluation.metrics import likeness


def people(
    random: np.random.Generator, shift: float = 0.0, own: float = 1.0
) -> tuple[np.ndarray, ...]:
    """Features [W, D] of ten people, whose means differ by `own`, and whose they are."""
    owners = np.repeat(np.arange(10), 12)
    means = own * random.standard_normal((10, 6))
    rows = means[owners] + 0.5 * random.standard_normal((len(owners), 6))
    rows[:, 2] += shift
    return rows, owners


def test_auc_counts_pairs() -> None:
    positive = np.array([True, True, False, False])
    assert likeness.auc(np.array([3.0, 4, 1, 2]), positive) == 1
    assert likeness.auc(np.array([1.0, 2, 3, 4]), positive) == 0
    assert likeness.auc(np.array([1.0, 3, 2, 0]), positive) == 0.75
    assert likeness.auc(np.zeros(4), positive) == 0.5, "ties count half"


def test_what_differs_is_told_apart_and_what_does_not_is_not() -> None:
    random = np.random.default_rng(1)
    (made, makers), (recorded, owners) = people(random, shift=4.0), people(random)
    assert likeness.told_apart(made, recorded, makers, owners) > 0.9
    same = [
        likeness.told_apart(*_apart(people(np.random.default_rng(s)), people(random)))
        for s in range(20)
    ]
    assert np.mean(same) == pytest.approx(0.5, abs=0.12)


def test_people_are_not_recognised_as_themselves() -> None:
    """With windows of a person on both sides of a fold, the classifier would memorise people."""
    random = np.random.default_rng(0)
    scores = []
    for _ in range(20):
        one, other = people(random, own=5.0), people(random, own=5.0)
        scores.append(likeness.told_apart(*_apart(one, other)))
    assert np.mean(scores) == pytest.approx(0.5, abs=0.15)


def test_one_person_gives_no_answer() -> None:
    rows = np.random.default_rng(0).standard_normal((30, 4))
    alone = np.zeros(30, int)
    assert np.isnan(likeness.told_apart(rows, rows, alone, alone))


def test_matched_samples_have_the_same_number_at_each_speed() -> None:
    random = np.random.default_rng(0)
    slow, fast = random.uniform(0.9, 1.2, 300), random.uniform(1.0, 1.5, 80)
    one, other = likeness.matched(slow, fast, random)
    assert len(one) == len(other) > 20 and len(set(one)) == len(one)
    assert slow[one].min() >= 1.0 and fast[other].max() < 1.2
    assert slow[one].mean() == pytest.approx(fast[other].mean(), abs=0.03)
    assert [len(rows) for rows in likeness.matched(slow, slow + 5, random)] == [0, 0]


def _apart(one: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
    return one[0], other[0], one[1], other[1]
