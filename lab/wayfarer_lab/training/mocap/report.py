"""The quality of a prepared data set: errors before and after the fit, amounts, skipped files."""

import json
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from wayfarer.body.model import BodyModel
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.metrics import contact
from wayfarer_lab.evaluation.tracks import skin_track
from wayfarer_lab.training.mocap.figure import draw
from wayfarer_lab.training.mocap.fit import FittedClip
from wayfarer_lab.training.mocap.fitting import Fits
from wayfarer_lab.training.mocap.rig import JOINT_NAMES
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import Dataset, atomically


@dataclass(frozen=True)
class Quality:
    """Figures over all frames of some clips."""

    frames: int
    joint_error_cm: float
    joint_error_p95_cm: float
    joint_error_by_joint_cm: dict[str, float]
    slide_cm_s: float  # median speed of the lowest sole marker below 3 cm
    both_feet_skating_percent: float
    penetration_1cm_percent: float  # frames whose lowest marker is more than 1 cm under the floor
    floating_5cm_percent: float
    strict_contact: float


def quality(clips: list[FittedClip], bodies: dict[str, BodyModel]) -> Quality:
    """Measures fitted (or copied) clips; see `evaluation.metrics.contact` for the definitions."""
    errors = np.concatenate([c.joint_error for c in clips])
    known = ~np.isnan(errors[0])
    slide, skate, deep, floating, strict = [], [], [], [], []
    for clip in clips:
        body = bodies[clip.shape.gender]
        track = skin_track(body, clip.shape.betas, clip.translation, clip.rotations)
        soles = track.markers[:, body.sole_markers].astype(np.float64)
        slide.append(contact.slide_speed(soles))
        skate.append(contact.both_feet_skating(soles))
        deep.append(contact.penetration(track.markers) > 0.01)
        floating.append(contact.clearance(track.markers) > contact.FLOATING)
        strict.append(contact.strict_contact(soles))
    return Quality(
        frames=len(errors),
        joint_error_cm=100 * float(errors[:, known].mean()),
        joint_error_p95_cm=100 * float(np.percentile(errors[:, known], 95)),
        joint_error_by_joint_cm={
            n: round(100 * float(errors[:, j].mean()), 2)
            for j, n in enumerate(JOINT_NAMES)
            if known[j]
        },
        slide_cm_s=100 * float(np.nanmedian(slide)),
        both_feet_skating_percent=100 * float(np.concatenate(skate).mean()),
        penetration_1cm_percent=100 * float(np.concatenate(deep).mean()),
        floating_5cm_percent=100 * float(np.concatenate(floating).mean()),
        strict_contact=float(np.concatenate(strict).mean()),
    )


def minutes(dataset: Dataset) -> dict[str, dict[str, float]]:
    """Minutes of frames in use, by "split / category" and by "split / augmentation"."""
    table: dict[str, dict[str, float]] = defaultdict(lambda: dict.fromkeys(_COLUMNS, 0.0))
    for clip in dataset.clips:
        use = dataset.use[clip.start : clip.stop]
        recorded = clip.augmentation or "as recorded"
        for key in (f"{clip.split} / {clip.category or 'unnamed'}", f"{clip.split} / {recorded}"):
            for kind in Use:
                table[key][kind.name.lower()] += float((use == kind).sum()) / FPS / 60
            table[key]["clips"] += 1
    return {k: {c: round(v, 2) for c, v in row.items()} for k, row in sorted(table.items())}


_COLUMNS = ("clips", *(u.name.lower() for u in Use))


def write_report(
    folder: Path,
    dataset: Dataset,
    fits: list[Fits],
    skipped: list[str],
    notes: list[str],
    bodies: dict[str, BodyModel],
) -> None:
    """Writes report.json, report.md and report.png beside the data."""
    groups: dict[str, dict[str, Quality]] = {}
    for kind in sorted({_kind(f.fitted) for f in fits}):
        alike = [f for f in fits if _kind(f.fitted) == kind]
        chosen = [f for f in alike if f.fitted.shape.kind == "own"] or alike
        groups[kind] = {
            "copied": quality([f.copied for f in chosen], bodies),
            "fitted": quality([f.fitted for f in chosen], bodies),
        }
    amounts = minutes(dataset)
    document = {
        "quality": {k: {s: asdict(q) for s, q in g.items()} for k, g in groups.items()},
        "minutes": amounts,
        "skipped": skipped,
        "notes": notes,
    }
    atomically(folder / "report.json", lambda p: p.write_text(json.dumps(document, indent=1)))
    text = "\n".join(_markdown(groups, amounts, skipped, notes))
    atomically(folder / "report.md", lambda p: p.write_text(text))
    draw(folder, dataset, fits)


def _kind(clip: FittedClip) -> str:
    what = "locomotion" if clip.info.locomotion else "other"
    return f"{clip.info.split} {what} {clip.info.augmentation or 'as recorded'}"


def _markdown(
    groups: dict[str, dict[str, Quality]],
    amounts: dict[str, dict[str, float]],
    skipped: list[str],
    notes: list[str],
) -> list[str]:
    lines = [
        "# Prepared motion",
        "",
        "## Retargeting, before (copied rotations) and after the fit",
        "",
    ]
    lines += [
        "| clips | | frames | joint error cm, mean / p95 | slide cm/s | both feet skating % "
        "| > 1 cm under the floor % | > 5 cm above it % | strict contact |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for kind, stages in groups.items():
        for stage, q in stages.items():
            lines.append(
                f"| {kind} | {stage} | {q.frames} | {q.joint_error_cm:.1f} / "
                f"{q.joint_error_p95_cm:.1f} | {q.slide_cm_s:.1f} | "
                f"{q.both_feet_skating_percent:.2f} | {q.penetration_1cm_percent:.2f} | "
                f"{q.floating_5cm_percent:.1f} | {q.strict_contact:.3f} |"
            )
    lines += ["", "Joint error by joint, cm (fitted):", ""]
    for kind, stages in groups.items():
        by_joint = stages["fitted"].joint_error_by_joint_cm
        lines.append(f"- {kind}: " + ", ".join(f"{n} {e}" for n, e in by_joint.items()))
    lines += ["", "## Minutes in use", "", "| | " + " | ".join(_COLUMNS) + " |"]
    lines.append("|---" * (len(_COLUMNS) + 1) + "|")
    for key, row in amounts.items():
        lines.append(f"| {key} | " + " | ".join(f"{row[c]:g}" for c in _COLUMNS) + " |")
    lines += ["", f"## Skipped ({len(skipped)})", ""]
    lines += [f"- {s}" for s in skipped] or ["none"]
    lines += ["", f"## Notes ({len(notes)})", ""]
    lines += [f"- {s}" for s in notes] or ["none"]
    return lines
