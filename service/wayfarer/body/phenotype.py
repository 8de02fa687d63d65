"""Betas from a description of a body: height in metres, weight, muscle, age.

A quadratic regression, fitted over the identities of the bake and stored in the body's file,
gives the betas of an average person of that description; the height is then met exactly by a
search along the regression's own height, so that a taller body has a taller person's build.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayfarer.body.library import body_file, load_arrays, load_body
from wayfarer.body.model import MAX_BETA, BodyModel
from wayfarer.errors import InvalidArgument

Array = NDArray[np.floating[Any]]

LIMITS: Final[Mapping[str, tuple[float, float]]] = {
    "height_m": (1.45, 2.05),  # metres, barefoot, standing straight
    "weight": (0.0, 1.0),  # 0 thin, 0.5 average, 1 heavy
    "muscle": (0.0, 1.0),  # 0 slack, 0.5 average, 1 athletic
    "age": (20.0, 80.0),  # years
}
"""Allowed range of each phenotype value, in the order of the regression's inputs."""

TOLERANCE: Final = 1e-4  # metres
_CROWN: Final = 0.03  # metres below the top of the head within which the highest vertex lies


def betas_from_phenotype(
    gender: str,
    height_m: float,
    weight: float = 0.5,
    muscle: float = 0.5,
    age: float = 35.0,
) -> Array:
    """Betas [10] of an anny52 body whose height is `height_m` within 1 mm.

    Raises:
        NotFound: no such gender.
        InvalidArgument: a value is not finite or outside LIMITS; the message gives the range.
    """
    values = {"height_m": height_m, "weight": weight, "muscle": muscle, "age": age}
    for field, value in values.items():
        low, high = LIMITS[field]
        if not low <= value <= high:  # false for NaN too
            raise InvalidArgument(f"{field} must lie in [{low:g}, {high:g}], not {value:g}", field)
    crown = _crown_of("anny52", gender)
    arrays = load_arrays(body_file("anny52", gender))
    scale, weights = arrays["phenotype_scale"], arrays["phenotype_weights"]

    def build(asked: float) -> Array:
        found = _features(np.array([asked, weight, muscle, age]), scale) @ weights
        return np.asarray(np.clip(found, -MAX_BETA, MAX_BETA))  # minor betas, far from average

    asked = height_m
    for _ in range(20):
        betas = build(asked)
        miss = height_m - crown.height(betas)
        if abs(miss) < TOLERANCE:
            break
        asked += miss  # the regression's height is near the true one: slope about 1
    return betas


def height_of(gender: str, betas: ArrayLike, name: str = "anny52") -> float:
    """Height in metres of the T-pose, from sole to crown. Raises NotFound, InvalidArgument."""
    return _crown_of(name, gender).height(load_body(name, gender).check_betas(np.asarray(betas)))


def fit(body: BodyModel, betas: Array, described: Array) -> dict[str, NDArray[Any]]:
    """Fits the regression (build time): betas [N, B] of identities, described [N, 3] as weight,
    muscle and age.

    Heights are those of the baked bodies. Returns the arrays of the body file; in it
    `phenotype_error` [B] is the standard deviation of each beta that a description leaves open.
    """
    crown = _Crown.of(body)
    heights = np.array([crown.height(row) for row in betas])
    values = np.column_stack([heights, described])
    scale = np.stack([values.mean(0), values.std(0)])
    features = _features(values, scale)
    weights = np.linalg.lstsq(features, betas, rcond=None)[0]
    return {
        "phenotype_scale": scale,
        "phenotype_weights": weights,
        "phenotype_error": (features @ weights - betas).std(0),
    }


def _features(values: Array, scale: Array) -> Array:
    """Constant, linear and quadratic terms [..., 15] of standardised values [..., 4]."""
    x = (values - scale[0]) / scale[1]
    pairs = combinations_with_replacement(range(x.shape[-1]), 2)
    squares = [x[..., i] * x[..., j] for i, j in pairs]
    return np.stack([np.ones(x.shape[:-1]), *np.moveaxis(x, -1, 0), *squares], -1)


@dataclass(frozen=True)
class _Crown:
    """Heights of the vertices that may be the highest: linear in betas."""

    mean: Array  # [C]
    dirs: Array  # [C, B]

    @classmethod
    def of(cls, body: BodyModel) -> "_Crown":
        every = body.rest_vertices(np.zeros(body.betas))[:, 2]
        top = np.flatnonzero(every > every.max() - _CROWN)
        units = [body.rest_vertices(unit, top)[:, 2] for unit in np.eye(body.betas)]
        return cls(every[top], np.stack(units, -1) - every[top, None])

    def height(self, betas: Array) -> float:
        return float((self.mean + self.dirs @ betas).max())


@cache
def _crown_of(name: str, gender: str) -> _Crown:
    return _Crown.of(load_body(name, gender))
