"""Body shapes for a subject: their own proportions, and random adults."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from wayfarer.body.model import BodyModel
from wayfarer.spec import BETAS
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.skeleton import Array

# Segments that both skeletons define alike, with the trust we put in each.
SEGMENTS = (
    ("hip", "knee", 1.0),
    ("knee", "ankle", 1.0),
    ("ankle", "foot", 0.3),
    ("shoulder", "elbow", 0.8),
    ("elbow", "wrist", 0.8),
)
TORSO_TRUST, WIDTH_TRUST = 0.6, 0.2
SIGMA = 0.02  # metres: mismatch of a fully trusted length that weighs as much as one beta
RANDOM_LIMIT = 2.0  # standard deviations of random adults' coefficients


@dataclass(frozen=True)
class RetargetShape:
    """A body to retarget to."""

    gender: str
    betas: Array  # [10]
    kind: str  # "own" proportions or "random"


def segment_lengths(places: Array) -> Array:
    """Lengths [K] in metres: `SEGMENTS` (mean of both sides), torso, shoulder and hip width."""
    lengths = [
        np.mean(
            [
                np.linalg.norm(places[J[f"{side}_{a}"]] - places[J[f"{side}_{b}"]])
                for side in ("left", "right")
            ]
        )
        for a, b, _ in SEGMENTS
    ]
    hips = (places[J["left_hip"]] + places[J["right_hip"]]) / 2
    lengths.append(np.linalg.norm(places[J["neck"]] - hips))
    lengths += [
        np.linalg.norm(places[J[f"left_{part}"]] - places[J[f"right_{part}"]])
        for part in ("shoulder", "hip")
    ]
    return np.array(lengths)


def own_shape(body: BodyModel, rest: Array) -> RetargetShape:
    """The body of this gender whose segments are nearest to the subject's rest places [22, 3]."""
    wanted = segment_lengths(rest)
    trust = np.array([t for *_, t in SEGMENTS] + [TORSO_TRUST, WIDTH_TRUST, WIDTH_TRUST])

    def misfit(betas: Array) -> Array:
        lengths = segment_lengths(body.rest_joints(betas))
        return np.concatenate([trust * (lengths - wanted) / SIGMA, betas])

    betas = least_squares(misfit, np.zeros(BETAS), diff_step=1e-3).x
    return RetargetShape(body.gender, np.clip(betas, -3, 3), "own")


def random_shape(body: BodyModel, generator: np.random.Generator) -> RetargetShape:
    """A random adult: unit-variance coefficients, no extremes."""
    betas = np.clip(generator.standard_normal(BETAS), -RANDOM_LIMIT, RANDOM_LIMIT)
    return RetargetShape(body.gender, betas, "random")
