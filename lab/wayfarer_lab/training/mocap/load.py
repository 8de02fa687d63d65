"""A motion file → clean 40 fps pieces in our frame. The floor is set later, per subject."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfarer.errors import DataError
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap import repair
from wayfarer_lab.training.mocap.amass import SUFFIX, read_amass
from wayfarer_lab.training.mocap.asf import load_asf, read_amc
from wayfarer_lab.training.mocap.bvh import read_bvh
from wayfarer_lab.training.mocap.resample import resample
from wayfarer_lab.training.mocap.rig import ClipInfo, J, to_our_joints
from wayfarer_lab.training.mocap.skeleton import Array, SkeletonMotion
from wayfarer_lab.training.mocap.sources import SourceFile

MIN_FPS = 24  # a fast step, four a second, keeps six frames; fewer lose its shape
MIN_FRAMES = 20  # shorter pieces (0.5 s) hold no two primitives


@dataclass(frozen=True)
class Piece:
    """A clean stretch of a clip before its floor is known. Arrays as in `SourceClip`."""

    info: ClipInfo
    places: Array
    rotations: Array
    rest: Array


@dataclass(frozen=True)
class ReadOptions:
    """How to read what the files do not say."""

    fps: float = 120.0  # of AMC files, which do not state it
    unit: float | None = None  # metres per unit of BVH files; None: from the length of the legs
    up: str = "y"  # upward axis of BVH and AMC files
    bvh_fix: bool = True  # mend CMU's BVH conversion where its pattern is seen
    smpl_models: Path | None = None  # folder of the body models that AMASS files belong to


def load_pieces(entry: SourceFile, asf_path: Path | None, options: ReadOptions) -> list[Piece]:
    """Read, repair and resample one file.

    Raises DataError, which names file and line, and ArtifactError when an AMASS file's body model
    cannot be read.
    """
    motion, unit, up = _read(entry, asf_path, options)
    fps = entry.fps or motion.fps or options.fps
    if fps < MIN_FPS - 1e-3:
        raise DataError(
            f"{fps:.1f} frames per second; at least {MIN_FPS} are needed", str(entry.path)
        )
    try:
        places, rotations, rest = to_our_joints(motion, unit, up)
    except DataError as error:
        raise DataError(str(error), str(entry.path)) from error
    arms = rotations[:, [J["left_shoulder"], J["right_shoulder"]]]
    shoulders = rotations[:, [J["left_collar"], J["right_collar"]]]
    start = repair.missing_arm_frames(np.swapaxes(shoulders, -1, -2) @ arms)
    pieces: list[Piece] = []
    for first, last in repair.clean_pieces(places, fps, start, entry.glitch_at):
        p, r = resample(places[first:last], rotations[first:last], fps, FPS)
        if len(p) < MIN_FRAMES:
            continue
        name = f"{entry.name}.{len(pieces) + 1}" if pieces else entry.name
        info = ClipInfo(
            name=name,
            source=entry.name,
            subject=entry.subject,
            split=entry.split,
            category=entry.category,
            locomotion=True if entry.locomotion is None else entry.locomotion,
            scene_contact=entry.scene_contact,
        )
        pieces.append(Piece(info, p, r, rest))
    if not pieces:
        raise DataError(f"no clean stretch of {MIN_FRAMES / FPS} s", str(entry.path))
    return pieces


def _read(
    entry: SourceFile, asf_path: Path | None, options: ReadOptions
) -> tuple[SkeletonMotion, float | None, str]:
    """A file's motion, its unit in metres and its upward axis."""
    if entry.path.suffix.lower() == SUFFIX:
        return read_amass(entry.path, options.smpl_models), 1.0, "y"
    text = entry.path.read_text(errors="replace")
    if entry.path.suffix.lower() == ".amc":
        if asf_path is None:
            raise DataError(f"no skeleton {entry.subject}.asf beside it", str(entry.path))
        asf = load_asf(asf_path)
        return read_amc(text, asf, str(entry.path)), asf.unit, options.up
    motion = repair.drop_t_pose(read_bvh(text, str(entry.path)))
    if options.bvh_fix:
        asf_skeleton = load_asf(asf_path).skeleton if asf_path else None
        skeleton = repair.mend_cmu_bvh(motion.skeleton, asf_skeleton)
        motion = SkeletonMotion(skeleton, motion.root, motion.local, motion.fps)
    return motion, options.unit, options.up
