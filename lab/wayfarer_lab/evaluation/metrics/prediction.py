"""Errors and diversity of predictors and regressors: pure functions of arrays.

Metres. Predictor futures are flattened markers [..., F, 201] in the canonical frame of their seed:
K samples for each seed against the true future.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument

Array = NDArray[np.floating[Any]]


def ade(samples: Array, truth: Array) -> Array:
    """Average displacement error, metres: the best of K futures [..., K, F, D] by the mean over
    frames of the L2 distance of whole flattened poses to `truth` [..., F, D]. [...]
    """
    return _distance(samples, truth).mean(-1).min(-1)


def fde(samples: Array, truth: Array) -> Array:
    """Final displacement error: as `ade`, the last frame only, with its own best sample. [...]"""
    return _distance(samples, truth)[..., -1].min(-1)


def apd(samples: Array) -> Array:
    """Average pairwise distance, metres: mean L2 between K ≥ 2 futures [..., K, F, D], each
    flattened over frames and coordinates; more is more diverse. [...]
    """
    flat = samples.reshape(*samples.shape[:-2], -1)
    first, second = np.triu_indices(flat.shape[-2], 1)
    if first.size == 0:
        raise InvalidArgument("diversity needs two samples or more per seed")
    return np.linalg.norm(flat[..., first, :] - flat[..., second, :], axis=-1).mean(-1)


def multimodal_errors(
    samples: Array, truths: Array, seeds: Array, epsilon: float
) -> tuple[float, float]:
    """MMADE and MMFDE, metres (DLow): the true futures of all seeds that are alike count as true.

    samples [N, K, F, D], truths [N, F, D], seeds [N, E] (the last seed frame, flattened).
    Seeds are alike when their L2 distance is at most `epsilon` (metres over all markers
    together). The figures mean nothing without its value.
    """
    average, final = [], []
    for row, seed in enumerate(seeds):
        alike = truths[np.linalg.norm(seeds - seed, axis=-1) <= epsilon]
        distance = _every_distance(samples[row], alike)
        average.append(distance.mean(-1).min(-1).mean())
        final.append(distance[..., -1].min(-1).mean())
    return float(np.mean(average)), float(np.mean(final))


def _distance(samples: Array, truth: Array) -> Array:
    """L2 distance of whole poses: [..., K, F]."""
    return np.linalg.norm(samples - truth[..., None, :, :], axis=-1)


def _every_distance(samples: Array, truths: Array) -> Array:
    """L2 distance of whole poses, samples [K, F, D] against each of truths [N, F, D]: [N, K, F].

    By |a - b|² = |a|² + |b|² - 2ab: a thousand times thousands of pairs would not fit in memory.
    """
    a, b = samples.astype(np.float64), truths.astype(np.float64)
    products = np.einsum("kfd,nfd->nkf", a, b, optimize=True)
    squares = (a * a).sum(-1) + (b * b).sum(-1)[:, None] - 2 * products
    return np.sqrt(np.maximum(squares, 0.0))


def amd(predicted: Array, truth: Array) -> float:
    """Average marker distance, millimetres: mean L2 over markers [..., M, 3]."""
    return float(np.linalg.norm(predicted - truth, axis=-1).mean()) * 1000


def avd(predicted: Array, truth: Array) -> float:
    """Average vertex distance, millimetres: as `amd`, over all vertices of the skinned mesh."""
    return amd(predicted, truth)
