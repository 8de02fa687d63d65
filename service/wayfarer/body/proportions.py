"""Betas with a character's distances between joints: a body with its legs takes its steps.

Bounded least squares over distances between joints, with a standard normal prior on the betas,
which have unit variance. Distances within one bone do not change with the pose, so a character may
be in A-pose or T-pose.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.body.skeleton import joint_names
from wayfarer.errors import InvalidArgument
from wayfarer.spec import GENDERS, POSED_JOINTS

Array = NDArray[np.floating[Any]]

BOUND: Final = 3.0
"""Largest fitted beta: three standard deviations. Beyond it the mesh is no likely person."""
PRIOR: Final = 0.5
"""Weight of the prior: a character's bones may differ from an average person's."""
SAME_SIZE: Final = 0.01
"""Metres by which thigh and shin together may miss before a character counts as not human-sized."""
SCALE_SPREAD: Final = 0.5
"""Standard deviation of the logarithm of a character's scale."""
LEG: Final = (0.05, 20.0)
"""Least and greatest length of thigh and shin together, metres."""
FARTHEST: Final = 100.0
"""Greatest distance of a joint from the others, metres."""


class Measure(NamedTuple):
    """A distance, averaged over pairs of joints; weights are 1 / (`spread` metres)²."""

    spread: float
    pairs: tuple[tuple[str, str], ...]


def _both(spread: float, above: str, below: str) -> Measure:
    return Measure(spread, tuple((f"{s}_{above}", f"{s}_{below}") for s in ("left", "right")))


MEASURES: Final[Mapping[str, Measure]] = {
    "thigh": _both(0.005, "hip", "knee"),
    "shin": _both(0.005, "knee", "ankle"),
    "foot": _both(0.01, "ankle", "foot"),
    "upper_arm": _both(0.01, "shoulder", "elbow"),
    "forearm": _both(0.01, "elbow", "wrist"),
    "hips": Measure(0.02, (("left_hip", "right_hip"),)),
    "shoulders": Measure(0.02, (("left_shoulder", "right_shoulder"),)),
    "torso": Measure(0.02, (("hips", "shoulders"),)),
}
"""Legs count most, since steps depend on them. Places of hips and shoulders differ most."""
MIDDLES: Final = {
    "hips": ("left_hip", "right_hip"),
    "shoulders": ("left_shoulder", "right_shoulder"),
}
ANKLES: Final = ("left_ankle", "right_ankle")
ANKLE_HEIGHT: Final = "ankle_height"
ANKLE_SPREAD: Final = 0.005
BAREFOOT: Final = 0.25
"""Share by which ankles may be higher or lower than those of the mean body with such legs. Beyond
it a shoe lifts them, or the rig puts the joint in another place: that is no length of a leg.
"""
SOFTER: Final = 5.0
"""Factor of all spreads except thigh's and shin's, in the search for a body of scale 1 that has
these legs, whatever its other lengths.
"""
REQUIRED: Final = tuple(f"{s}_{b}" for s in ("left", "right") for b in ("hip", "knee", "ankle"))


@dataclass(frozen=True)
class FittedLength:
    """One distance, in metres of the character."""

    name: str
    character_m: float
    body_m: float  # of the fitted body, × scale

    @property
    def error_cm(self) -> float:
        """Centimetres by which the fitted body is longer."""
        return 100 * (self.body_m - self.character_m)


@dataclass(frozen=True)
class BodyFit:
    """A body with a character's proportions."""

    gender: str
    betas: tuple[float, ...]
    scale: float  # ratio of the character's size to the body's; 1: a person's size
    lengths: tuple[FittedLength, ...] = field(repr=False)


def fit_betas(
    joints: Mapping[str, Array],
    floor: float | None = None,
    gender: str | None = None,
    name: str = SHIPPED,
) -> BodyFit:
    """The body whose bones are as long as those between these joints [3], by canonical name.

    Places in metres, Z up, of the character at rest; hips, knees and ankles are needed, the other
    bones may be missing. `floor`: height under its soles; the ankles' height is free if it
    is None or heels lift them. `gender`: None means the better fit. The scale is 1 if a person of
    the gender, or of either, has such legs.
    Raises InvalidArgument when a joint is unknown, missing or unlike a leg.
    """
    _check(joints)
    wanted = _measured(joints)
    if floor is not None:
        height = float(np.mean([joints[ankle][2] for ankle in ANKLES])) - floor
        leg = wanted["thigh"] + wanted["shin"]
        if not 0 <= height <= leg:
            raise InvalidArgument(
                f"the ankles are {height:.3g} m over the floor; a leg of {leg:.3g} m has them "
                f"0 to {leg:.3g} m over it (up is the basis's up)",
                "floor",
            )
        wanted[ANKLE_HEIGHT] = height
    tried = [_fit(name, one, wanted) for one in ((gender,) if gender else GENDERS)]
    return min(tried, key=lambda found: (found[1].scale != 1.0, found[0]))[1]


def _check(joints: Mapping[str, Array]) -> None:
    known = joint_names()[:POSED_JOINTS]
    for bone, place in joints.items():
        if bone not in known:
            raise InvalidArgument(f"{bone!r} is no bone; bones are {', '.join(known)}", "joints")
        if np.shape(place) != (3,) or not np.isfinite(place).all():
            raise InvalidArgument(f"{bone}: a place is 3 finite numbers", "joints")
    lacking = [bone for bone in REQUIRED if bone not in joints]
    if lacking:
        raise InvalidArgument(f"{', '.join(lacking)} missing: a leg has 3 joints", "joints")
    size = np.ptp(np.stack(list(joints.values())), axis=0).max()
    if size > FARTHEST:
        raise InvalidArgument(
            f"the joints are {size:.3g} m apart, more than {FARTHEST:g} m: is the unit right?",
            "joints",
        )
    for side in ("left", "right"):
        chain = [joints[f"{side}_{bone}"] for bone in ("hip", "knee", "ankle")]
        thigh, shin = (float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(chain))
        if not LEG[0] <= thigh + shin <= LEG[1]:
            raise InvalidArgument(
                f"the {side} leg is {thigh + shin:.3g} m long; allowed: {LEG[0]:g} to "
                f"{LEG[1]:g} m: is the unit right?",
                "joints",
            )
        if min(thigh, shin) < 0.1 * max(thigh, shin):
            raise InvalidArgument(
                f"the {side} thigh is {thigh:.3g} m long and the shin {shin:.3g} m: "
                "one of the joints is another bone's",
                "joints",
            )


def _ends(joints: Mapping[str, Array]) -> dict[str, Array]:
    """The joints and the known midpoints of pairs of joints."""
    places = dict(joints)
    for middle, (left, right) in MIDDLES.items():
        if left in joints and right in joints:
            places[middle] = (joints[left] + joints[right]) / 2
    return places


def _measured(joints: Mapping[str, Array]) -> dict[str, float]:
    """Distances in metres between known joints."""
    places = _ends(joints)
    found = {}
    for name, measure in MEASURES.items():
        pairs = [(a, b) for a, b in measure.pairs if a in places and b in places]
        if pairs:
            lengths = [float(np.linalg.norm(places[a] - places[b])) for a, b in pairs]
            found[name] = float(np.mean(lengths))
    return found


@dataclass(frozen=True)
class _Lengths:
    """The measures of a body: its joints are linear in the betas."""

    mean: Array  # [M, P, 3] differences of the joints of up to P pairs; a single one occurs twice
    dirs: Array  # [M, P, 3, B]

    def at(self, betas: Array) -> tuple[Array, Array]:
        """Lengths [M] and their derivatives [M, B]."""
        between = self.mean + self.dirs @ betas
        lengths = np.linalg.norm(between, axis=-1)
        slopes = np.einsum("mpc,mpcb->mpb", between / lengths[..., None], self.dirs)
        return lengths.mean(1), slopes.mean(1)


def _leg_of(lengths: Mapping[str, float]) -> float:
    return lengths["thigh"] + lengths["shin"]


def _at_mean(name: str, gender: str, measures: tuple[str, ...]) -> list[float]:
    body = _lengths_of(name, gender, measures)
    return [float(length) for length in body.at(np.zeros(body.dirs.shape[-1]))[0]]


@cache
def _lengths_of(name: str, gender: str, measures: tuple[str, ...]) -> _Lengths:
    body = load_body(name, gender)
    rest = body.rest_joints(np.concatenate([np.zeros((1, body.betas)), np.eye(body.betas)]))
    linear = np.concatenate([rest[:1], rest[1:] - rest[:1]])  # [1 + B, J, 3]
    joints = {bone: linear[:, j] for j, bone in enumerate(body.joint_names)}
    places = _ends(joints)
    rows = []
    for measure in measures:
        if measure == ANKLE_HEIGHT:  # the body stands on the floor: only the height counts
            ends: list[tuple[Array, Array]] = [
                (joints[ankle] * (0, 0, 1), np.zeros(3)) for ankle in ANKLES
            ]
        else:
            ends = [(places[b], places[a]) for a, b in MEASURES[measure].pairs]
        rows.append(np.stack([b - a for b, a in (ends * 2)[:2]]))
    found = np.moveaxis(np.stack(rows), 2, -1)  # [M, P, 3, 1 + B]
    return _Lengths(found[..., 0], found[..., 1:])


def _fit(name: str, gender: str, wanted: Mapping[str, float]) -> tuple[float, BodyFit]:
    """(cost, fit) of one gender."""
    from scipy.optimize import least_squares  # saves 30 MB and .2 s on a server without fits

    if ANKLE_HEIGHT in wanted:
        mean = dict(zip(wanted, _at_mean(name, gender, tuple(wanted)), strict=True))
        barefoot = mean[ANKLE_HEIGHT] * _leg_of(wanted) / _leg_of(mean)
        if abs(wanted[ANKLE_HEIGHT] / barefoot - 1) > BAREFOOT:
            wanted = {n: length for n, length in wanted.items() if n != ANKLE_HEIGHT}
    body = _lengths_of(name, gender, tuple(wanted))
    target = np.array(list(wanted.values()))
    spreads = np.array([MEASURES[n].spread if n in MEASURES else ANKLE_SPREAD for n in wanted])
    count = body.dirs.shape[-1]

    def leg(betas: Array) -> float:
        return float(body.at(betas)[0][:2].sum())  # thigh and shin come first

    def solve(free_scale: bool, softer: float = 1.0) -> tuple[Array, float]:
        widths = spreads * np.where(np.arange(len(spreads)) < 2, 1.0, softer)
        prior = np.full(count + free_scale, PRIOR)
        bounds = np.full(len(prior), BOUND)
        start = np.zeros(len(prior))
        if free_scale:  # the last unknown: its logarithm
            prior[-1] = 1 / SCALE_SPREAD
            bounds[-1] = np.log(LEG[1] / LEG[0])
            start[-1] = np.log(target[:2].sum() / leg(start[:-1]))

        def residuals(x: Array) -> Array:
            shrunk = target * np.exp(-x[count:].sum())
            return np.concatenate([(body.at(x[:count])[0] - shrunk) / widths, prior * x])

        def slopes(x: Array) -> Array:
            columns = [body.at(x[:count])[1]]
            if free_scale:
                columns.append((target * np.exp(-x[-1]))[:, None])
            own = np.concatenate(columns, 1) / widths[:, None]
            return np.concatenate([own, np.diag(prior)])

        made = least_squares(residuals, start, slopes, bounds=(-bounds, bounds))
        return made.x[:count], float(np.exp(made.x[count:].sum()))

    for softer in (1.0, SOFTER):
        betas, scale = solve(free_scale=False, softer=softer)
        if abs(leg(betas) - target[:2].sum()) <= SAME_SIZE:
            break
    else:
        betas, scale = solve(free_scale=True)
    lengths = body.at(betas)[0]
    fitted = tuple(
        FittedLength(n, float(asked), float(got * scale))
        for n, asked, got in zip(wanted, target, lengths, strict=True)
    )
    missed = np.concatenate([(lengths - target / scale) / spreads, PRIOR * betas])
    return float(missed @ missed), BodyFit(
        gender, tuple(float(b) for b in betas.round(6)), scale, fitted
    )
