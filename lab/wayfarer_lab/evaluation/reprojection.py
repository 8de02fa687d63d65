"""The table of reprojection: the body regressor beside optimisation, as in MOJO (Sec. A.3)."""

import time
from collections.abc import Mapping, Sequence

import torch

from wayfarer.body.library import SHIPPED, load_body
from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.posing import to_columns, to_rows
from wayfarer.motion.regressor import Pose
from wayfarer.spec import NEW_FRAMES, SEED_FRAMES
from wayfarer_lab.evaluation.fitted import fit_body
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.model_parts import Variant
from wayfarer_lab.evaluation.models import Primitives, differences
from wayfarer_lab.evaluation.random_motion import Bench, judged
from wayfarer_lab.evaluation.realism import carried_figures, realism_row
from wayfarer_lab.evaluation.rollout import FrozenPoses


def reprojection(
    bench: Bench,
    poses: Sequence[FrozenPoses],
    primitives: int,
    recorded: Mapping[str, Primitives],
    iterations: Sequence[int],
) -> dict[str, list[Row]]:
    """The regressor beside optimisation of some iterations, as in MOJO: a row each.

    On `recorded` primitives, by gender and in canonical frames, whose seeds are known: the error of
    the bodies found, and the time that it takes. In random motion of the 2-frame model from
    `poses`: realism.

    Figures:
        ms_per_primitive: processor time to find the bodies of a primitive, in batches of recorded
            primitives, ÷ their number
    """
    rows = []
    for count in (0, *iterations):
        name = f"optimised, {count} iterations" if count else "regressed"
        bench.watch(name)
        variant = Variant(name, "ro-2f", fitted=count)
        made = bench.make(variant, poses, primitives * NEW_FRAMES)
        row = judged(name, made, lambda n, m: realism_row(n, m, bench.body))
        row |= carried_figures([r.sound() for r in made], bench.body.marker_names)
        rows.append(row | _accuracy(bench, recorded, count))
    return {"Reprojection": rows}


def _accuracy(bench: Bench, recorded: Mapping[str, Primitives], iterations: int) -> Row:
    """Errors over both genders, and milliseconds of processor time for a primitive of one body."""
    skins, rows = load_marker_bodies(), list[Row]()
    seconds, count = 0.0, 0
    for gender, truth in recorded.items():
        skin = skins[gender]
        markers = truth.markers(skin)
        with torch.no_grad():
            begun = time.process_time()
            if iterations:
                made = _fitted(skin, truth, markers, iterations)
            else:
                place, turns = bench.parts.regressors[gender](markers, truth.betas)
                made = Primitives(place, turns, truth.betas)
            seconds += time.process_time() - begun
        count += len(truth.betas)
        body = load_body(SHIPPED, gender, "low")
        rows.append(differences(gender, _new(made), _new(truth), body, skin))
    figures = ("amd_mm", "amd_p95_mm", "avd_mm", "joint_angle_deg")
    found = {name: sum(float(row[name]) for row in rows) / len(rows) for name in figures}
    return {"primitives": count, **found, "ms_per_primitive": 1000 * seconds / count}


def _fitted(
    body: MarkerBody, truth: Primitives, markers: torch.Tensor, iterations: int
) -> Primitives:
    """All frames; those of the seed are known, and the others are found from its last pose."""
    known = SEED_FRAMES - 1
    start = Pose(
        to_columns(truth.translation[:, known : known + 1]).transpose(0, 1),
        to_columns(truth.rotations[:, known : known + 1]).permute(2, 3, 1, 0, 4),
    )
    shape = body.shaped(truth.betas)
    found = fit_body(body, shape, markers[:, SEED_FRAMES:], start, iterations)
    place = to_rows(found.hips.transpose(0, 1))
    turns = to_rows(found.rotations.permute(3, 2, 0, 1, 4))
    return Primitives(
        torch.cat([truth.translation[:, :SEED_FRAMES], place], 1),
        torch.cat([truth.rotations[:, :SEED_FRAMES], turns], 1),
        truth.betas,
    )


def _new(poses: Primitives) -> Primitives:
    """The new frames, without those of the seed, which the optimisation is given."""
    return Primitives(
        poses.translation[:, SEED_FRAMES:], poses.rotations[:, SEED_FRAMES:], poses.betas
    )
