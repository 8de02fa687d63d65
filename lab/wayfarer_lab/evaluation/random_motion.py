"""The paper's tables of open rollouts: realism (Fig. 3), bodies (Sec. A.2), skating (Sec. A.3)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
import torch

from wayfarer.body.model import BodyModel
from wayfarer.spec import BETAS, FPS, NEW_FRAMES
from wayfarer_lab.evaluation.direct import roll_out_direct
from wayfarer_lab.evaluation.gait import Row, gait_row
from wayfarer_lab.evaluation.maneuvers.likeness import People, compare, windows_of
from wayfarer_lab.evaluation.metrics.frechet import Reference
from wayfarer_lab.evaluation.model_parts import Parts, Variant, some
from wayfarer_lab.evaluation.outcome import REACHED, STEP_LIMIT
from wayfarer_lab.evaluation.realism import (
    Array,
    JudgedMotion,
    PoseScore,
    carried_figures,
    realism_row,
    skating_row,
)
from wayfarer_lab.evaluation.rollout import (
    FrozenPoses,
    Goals,
    Rollout,
    ahead,
    always,
    random_goals,
    roll_out,
)
from wayfarer_lab.training.rotation import matrix_from_quaternion

Watch = Callable[[str], None]
"""Called with the name of each row before it is made."""

Maker = Callable[[Sequence[FrozenPoses], int], list[Rollout]]
"""Rollouts from poses, of a number of frames."""

SHAPES: Final = 10
"""Bodies between the two ends of the shape space, and start poses (Sec. A.2)."""


@dataclass(frozen=True)
class Bench:
    """What all rows of a table share."""

    parts: Parts
    body: BodyModel  # of either gender: it only names the markers
    seed: int
    watch: Watch = lambda name: None

    @property
    def pose_score(self) -> PoseScore | None:
        """How usual poses are to the pose prior: exp(-|μ|² / 32), as its reward; None without."""
        prior = self.parts.pose_prior
        if prior is None:
            return None

        def score(rotations: Array) -> Array:
            local = matrix_from_quaternion(torch.from_numpy(np.asarray(rotations, np.float32)))
            mean = prior.encode(local[:, 1:]).mean
            found: Array = torch.exp(-(mean * mean).mean(-1)).numpy()
            return found

        return score

    def make(self, variant: Variant, poses: Sequence[FrozenPoses], frames: int) -> list[Rollout]:
        """Rollouts of both genders; the same noise and goals for every variant and shape."""
        made = []
        for number, group in enumerate(poses):
            goals: Goals | None = None
            if variant.policy:
                count = len(group.betas)
                goals = random_goals(count, np.random.default_rng([self.seed, number]))
            made.append(self._roll(variant, group, frames, number, goals))
        return made

    def make_direct(self, name: str, poses: Sequence[FrozenPoses], frames: int) -> list[Rollout]:
        """As `make`, by the predictor of body parameters of that name."""
        return [
            roll_out_direct(self.parts.direct[name], group, frames, self._random(number))
            for number, group in enumerate(poses)
        ]

    def reach(self, variant: Variant, poses: Sequence[FrozenPoses]) -> Row:
        """How many of `poses` reach a goal 5 m ahead within 60 primitives, and in how many."""
        steps = []
        for number, group in enumerate(poses):
            targets = ahead(group)
            made = self._roll(variant, group, STEP_LIMIT * NEW_FRAMES, number, always(targets))
            way = made.hips[..., :2] - targets[:, None, :2].numpy()
            near = np.linalg.norm(way, axis=-1) < REACHED
            steps += [int(row.argmax()) // NEW_FRAMES + 1 for row in near if row.any()]
        count = sum(len(group.betas) for group in poses)
        return {
            "success_075m": len(steps) / count,
            "steps": float(np.mean(steps)) if steps else float("nan"),
        }

    def _roll(
        self, variant: Variant, poses: FrozenPoses, frames: int, number: int, goals: Goals | None
    ) -> Rollout:
        return roll_out(self.parts, variant, poses, frames, self._random(number), goals)

    def _random(self, number: int) -> torch.Generator:
        return torch.Generator().manual_seed(2 * self.seed + number)


def variants(parts: Parts) -> list[Variant]:
    """All variants of Fig. 3, and some of ours, as far as `parts` has them.

    *ro*: trained over rollouts. *reproj*: only reprojected markers are handed on; *pred*: only
    predicted ones; neither: their average. *ungrounded*: heights are left as they come.
    """
    wanted = [
        *(Variant(name, name) for name in ("1f", "2f", "ro-1f", "ro-2f")),
        Variant("reproj-1f", "1f", blend=1),
        Variant("reproj-2f", "2f", blend=1),
        Variant("ro-reproj-1f", "ro-1f", blend=1),
        Variant("ro-reproj-2f", "ro-2f", blend=1),
        Variant("ro-pred-1f", "ro-1f", blend=0),
        Variant("ro-pred-2f", "ro-2f", blend=0),
        Variant("ro-2f-ungrounded", "ro-2f", grounding=0),
        Variant("ro-policy", "ro-2f", policy=True),
    ]
    return [v for v in wanted if v.predictor in parts.predictors and (parts.policy or not v.policy)]


def realism(
    bench: Bench,
    poses: Sequence[FrozenPoses],
    seconds: float,
    mocap: JudgedMotion | None = None,
    reference: Reference | None = None,
    people: People | None = None,
    only: str = "",
) -> dict[str, list[Row]]:
    """Every variant from the same poses, and the recordings; all motion, and walking (Fig. 3).

    There is no search and no goal; bodies begin frozen in a pose. `only`: see `parts.some`. Names
    are the paper's: `1f` and `2f` are seed lengths; `ro` is trained over rollouts. Seeds are the
    average of predicted and reprojected markers; with `reproj` only reprojected ones, with `pred`
    only predicted ones. `ungrounded` is without our height correction. `ro-policy` draws latents
    from the policy on the way to random goals in 20 × 20 m (target speed 1.2 m/s), the others from
    N(0, I). Predictors of body parameters (Sec. A.4) are variants too. Every variant has the same
    poses and noise. 2-frame models get their first seed from a primitive of the 1-frame model, as
    in GAMMA; the first primitive does not count. Shipped models hold only the `ro` parts. The paper
    asks people; in their place a classifier tells motion from that of recorded `people` (`auc`).
    """
    body, walking = bench.body, list[Row]()

    def measure(name: str, motion: JudgedMotion) -> Row:
        windows = motion.windows().at_walking_speed()
        walking.append(gait_row(f"{name}, 0.9-1.4 m/s", windows, body.sole_markers))
        row = realism_row(name, motion, body, reference, bench.pose_score)
        if people is None:
            return row
        tracks = [track.markers for track in motion.tracks]
        own = windows_of(tracks, range(len(tracks)), body.marker_names)
        compared = compare(own, people)
        return row | {"auc": compared["auc"], "auc_windows": int(compared["compared"])}

    makers: dict[str, Maker] = {v.name: partial(bench.make, v) for v in variants(bench.parts)}
    makers |= {name: partial(bench.make_direct, name) for name in bench.parts.direct}
    rows = []
    for name, make in some(makers, only).items():
        bench.watch(name)
        made = make(poses, round(seconds * FPS))
        row = judged(name, made, measure)
        rows.append(row | carried_figures([r.sound() for r in made], body.marker_names))
    if mocap is not None:
        bench.watch("mocap")
        rows.append(measure("mocap", mocap))
    return {"Realism": rows, "At walking speed": walking}


def skating(
    bench: Bench, poses: Sequence[FrozenPoses], primitives: int, mocap: JudgedMotion | None = None
) -> dict[str, list[Row]]:
    """MOJO's measure of skating, and stricter ones, of each predictor and the policy (Sec. A.3).

    The paper reports 0.064 for GAMMA, 0.067 for its recordings, 0.341 and 0.278 for MOJO, on other
    bodies and data. It does not say whether its limit was MOJO's speed or MOJO's 5 mm a frame.
    """

    def measure(name: str, motion: JudgedMotion) -> Row:
        return skating_row(name, motion, bench.body)

    rows = []
    for variant in variants(bench.parts):
        if variant.name in bench.parts.predictors or variant.policy:
            bench.watch(variant.name)
            made = bench.make(variant, poses, primitives * NEW_FRAMES)
            rows.append(judged(variant.name, made, measure))
    if mocap is not None:
        bench.watch("mocap")
        rows.append(measure("mocap", mocap))
    return {"Skating": rows}


def bodies(
    bench: Bench,
    poses: Sequence[FrozenPoses],
    extent: float,
    futures: int,
    seconds: float,
    mocap: JudgedMotion | None = None,
) -> dict[str, list[Row]]:
    """Ten shapes from the same start poses, and each start pose on the mean shape (Sec. A.2).

    Shapes lie at -`extent` … `extent` standard deviations along the first two components together
    (the range of training is 2.5; the paper interpolates −6 … 6 of SMPL-X). Every row has `futures`
    rollouts of each of ten poses, or as many of one pose, with the same noise. Rows of *Spread* are
    standard deviations over shapes and over poses.

    Figures:
        success_075m: share that comes within 0.75 m of a goal 5 m ahead in 60 primitives; with the
            policy, without search
        steps: primitives until then
    """
    plain = next(v for v in reversed(variants(bench.parts)) if v.name in bench.parts.predictors)
    steered = next((v for v in variants(bench.parts) if v.policy), None)

    def measure(name: str, motion: JudgedMotion) -> Row:
        return realism_row(name, motion, bench.body, pose_score=bench.pose_score)

    def row(name: str, turns: torch.Tensor, betas: torch.Tensor) -> Row:
        bench.watch(name)
        group = [FrozenPoses(p.gender, turns, betas.expand(len(turns), -1)) for p in poses]
        made = judged(name, bench.make(plain, group, round(seconds * FPS)), measure)
        return made | bench.reach(steered, group) if steered else made

    turns = poses[0].rotations  # both genders get them
    every = turns.repeat_interleave(futures, 0)
    shapes, starts = [], []
    for size in np.linspace(-extent, extent, SHAPES):
        betas = torch.zeros(BETAS)
        betas[:2] = float(size)
        shapes.append(row(f"shape {size:+.2f}", every, betas))
    for number, turn in enumerate(turns):
        same = turn.expand(len(every), -1, -1)
        starts.append(row(f"pose {number}", same, torch.zeros(BETAS)))
    spread = [
        _over("std of shapes", shapes, np.std),
        _over("std of poses", starts, np.std),
        _over("mean of shapes", shapes, np.mean),
        _over("mean of poses", starts, np.mean),
    ]
    real = [measure("mocap", mocap)] if mocap is not None else []
    return {"Shapes": shapes + real, "Start poses": starts, "Spread": spread}


def judged(name: str, made: Sequence[Rollout], measure: Callable[[str, JudgedMotion], Row]) -> Row:
    """The row of a variant. `lost` counts rollouts that did not stay bodies; they are excluded."""
    sound = [rollout.sound() for rollout in made]
    tracks = [track for rollout in sound for track in rollout.tracks()]
    count = sum(len(rollout.hips) for rollout in made)
    row: Row = {"name": name, "motions": count, "lost": 1 - len(tracks) / count}
    return row | measure(name, JudgedMotion(tracks, made[0].seam_every)) if tracks else row


def _over(name: str, rows: Sequence[Row], take: Callable[[list[float]], np.floating[Any]]) -> Row:
    """Mean or standard deviation over rows of every figure that is not a count.

    Rows in which it could not be measured are left out.
    """
    figures = [k for k, v in rows[0].items() if isinstance(v, float) and k != "seconds"]
    found: Row = {"name": name}
    for figure in figures:
        values = [float(r.get(figure, np.nan)) for r in rows]
        known = [v for v in values if not np.isnan(v)]
        found[figure] = float(take(known)) if known else float("nan")
    return found
