"""A two-sample test: can a classifier distinguish made motion from recorded motion?

A classifier whose area under the ROC curve (AUC) is 0.5 on people it has not seen sees no
difference; with 1 it always does (Lopez-Paz and Oquab 2017, "Revisiting classifier two-sample
tests").
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

SHRINKAGE: Final = 0.1
"""Shrinkage of the within-class covariance towards a multiple of the identity."""

FOLDS: Final = 4

SPEED_BIN: Final = 0.1
"""Width of the speed bins in which two sets are matched, m/s."""


def matched(one: Array, other: Array, random: np.random.Generator) -> tuple[Index, Index]:
    """Rows of two sets of speeds [N], [M], so that both have as many in each bin of 0.1 m/s."""
    bins = [np.floor(speeds / SPEED_BIN).astype(int) for speeds in (one, other)]
    chosen: tuple[list[Index], list[Index]] = ([], [])
    for number in np.intersect1d(bins[0], bins[1]):
        rows = [np.flatnonzero(b == number) for b in bins]
        count = min(map(len, rows))
        for side, found in zip(chosen, rows, strict=True):
            side.append(random.choice(found, count, replace=False))
    empty = np.zeros(0, np.int64)
    return np.concatenate([empty, *chosen[0]]), np.concatenate([empty, *chosen[1]])


def auc(scores: Array, positive: NDArray[np.bool_]) -> float:
    """Share of pairs in which the positive one scores higher; ties count half."""
    order = np.argsort(scores, kind="stable")
    ranks = np.empty(len(scores))
    _, inverse, counts = np.unique(scores[order], return_inverse=True, return_counts=True)
    ends = np.cumsum(counts)
    ranks[order] = (ends - (counts - 1) / 2)[inverse]
    wins = ranks[positive].sum() - positive.sum() * (positive.sum() + 1) / 2
    return float(wins / (positive.sum() * (~positive).sum()))


def told_apart(made: Array, recorded: Array, makers: Index, people: Index) -> float:
    """AUC of a linear classifier between features made [N, D] and recorded [M, D].

    Shrunk linear discriminant analysis. `makers` [N] and `people` [M] say whose a row is: all of
    one person or take are in the same of 4 folds, and only those of other folds are learnt from.
    The mean over folds; NaN when there are too few people on a side for two folds.
    """
    sides = [_folds(makers), _folds(people)]
    scored = []
    for fold in range(FOLDS):
        test = [side == fold for side in sides]
        if any(t.all() or not t.any() for t in test):
            continue
        direction = _discriminant(made[~test[0]], recorded[~test[1]])
        held = np.concatenate([made[test[0]], recorded[test[1]]]) @ direction
        scored.append(auc(held, np.arange(len(held)) < test[0].sum()))
    return float(np.mean(scored)) if len(scored) >= 2 else float("nan")


def _folds(owners: Index) -> Index:
    """The fold of each row: owners in turn, those with most rows first."""
    names, inverse, counts = np.unique(owners, return_inverse=True, return_counts=True)
    place = np.empty(len(names), np.int64)
    place[np.argsort(-counts, kind="stable")] = np.arange(len(names)) % FOLDS
    return place[inverse]


def _discriminant(one: Array, other: Array) -> Array:
    scale = np.concatenate([one, other]).std(0) + 1e-9
    one, other = one / scale, other / scale
    within = (one - one.mean(0)).T @ (one - one.mean(0))
    within += (other - other.mean(0)).T @ (other - other.mean(0))
    within /= max(len(one) + len(other) - 2, 1)
    size = len(within)
    shrunk = (1 - SHRINKAGE) * within + SHRINKAGE * np.trace(within) / size * np.eye(size)
    return np.linalg.solve(shrunk, one.mean(0) - other.mean(0)) / scale
