"""A motion file → clean 40 fps pieces in our frame. The floor is set later, per subject."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wayfarer.errors import DataError
from wayfarer.spec import FPS
from wayfarer_lab.training.mocap import amass, fbx, repair
from wayfarer_lab.training.mocap.asf import load_asf, read_amc
from wayfarer_lab.training.mocap.bvh import read_bvh
from wayfarer_lab.training.mocap.conversion import to_our_joints
from wayfarer_lab.training.mocap.joints import joint_map
from wayfarer_lab.training.mocap.resample import resample
from wayfarer_lab.training.mocap.rig import ClipInfo, J
from wayfarer_lab.training.mocap.skeleton import Array, SkeletonMotion
from wayfarer_lab.training.mocap.sources import SourceFile
from wayfarer_lab.training.mocap.stance import RestFrame, rest_axis, stands, upward_axis
from wayfarer_lab.training.mocap.text import read_text

MIN_FPS = 23.9  # a fast step, four a second, keeps six frames; 23.976 is the rate of film
SAME_RATE = 0.01  # fraction by which rates of file and index may differ, by rounding
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
    unit: float | None = None  # metres per unit of BVH and FBX files; None: from the legs' length
    up: str | None = None  # upward axis of BVH, AMC and FBX files; None: as their zero pose stands
    bvh_fix: bool = True  # mend CMU's BVH conversion where its pattern is seen
    smpl_models: Path | None = None  # folder of the body models that AMASS files belong to
    reference: str = ""  # FRAME or CLIP:FRAME in which the person stands, see `References`


@dataclass(frozen=True)
class Recording:
    """One motion of a file, as the file has it."""

    entry: SourceFile
    name: str
    motion: SkeletonMotion
    unit: float | None  # metres per unit; None: from the length of the legs
    up: str | None  # upward axis of the world; None: as the zero pose stands

    @property
    def stands(self) -> bool:
        """Whether its zero pose can be the rest pose. Raises DataError for unknown joints."""
        skeleton = self.motion.skeleton
        return stands(skeleton.rest_places()[joint_map(skeleton)])


def read_recordings(
    entry: SourceFile, asf_path: Path | None, options: ReadOptions
) -> list[Recording]:
    """The motions of one file: an FBX may hold several takes.

    Raises DataError, which names file and line, and ArtifactError when an AMASS file's body model
    cannot be read.
    """
    suffix = entry.path.suffix.lower()
    if suffix == amass.SUFFIX:
        motion = amass.read_amass(entry.path, options.smpl_models)
        return [Recording(entry, entry.name, motion, 1.0, "y")]
    if suffix == fbx.SUFFIX:
        takes = fbx.read_fbx(entry.path)
        names = [f"{entry.name}.{t.name}" if len(takes) > 1 else entry.name for t in takes]
        return [
            Recording(entry, name, take.motion, options.unit, options.up)
            for name, take in zip(names, takes, strict=True)
        ]
    text = read_text(entry.path)
    if suffix == ".amc":
        if asf_path is None:
            raise DataError(f"no skeleton {entry.subject}.asf beside it", str(entry.path))
        asf = load_asf(asf_path)
        motion = read_amc(text, asf, str(entry.path))
        return [Recording(entry, entry.name, motion, asf.unit, options.up)]
    motion = read_bvh(text, str(entry.path))
    if options.bvh_fix:
        asf_skeleton = load_asf(asf_path).skeleton if asf_path else None
        motion = replace(motion, skeleton=repair.mend_cmu_bvh(motion.skeleton, asf_skeleton))
    return [Recording(entry, entry.name, motion, options.unit, options.up)]


def load_pieces(
    recording: Recording,
    options: ReadOptions,
    reference: RestFrame | None = None,
    up: str | None = None,
    tell: Callable[[str], None] = print,
) -> list[Piece]:
    """Repairs and resamples one recording. `tell` receives what the user should know of it.

    `reference` is its rest pose where its zero pose does not stand, `up` the axis along which that
    was seen to stand. Raises DataError, which names the file.
    """
    entry, path = recording.entry, str(recording.entry.path)
    motion = recording.motion
    if reference is None and entry.path.suffix.lower() == ".bvh":
        motion = repair.drop_t_pose(motion)
    fps = entry.fps or motion.fps or options.fps
    if entry.fps and motion.fps and abs(entry.fps / motion.fps - 1) > SAME_RATE:
        tell(
            f"{recording.name}: the index says {entry.fps:g} frames a second, the file "
            f"{motion.fps:g}; the index counts"
        )
    if fps < MIN_FPS:
        raise DataError(f"{fps:.3g} frames per second; at least 24 are needed", path)
    try:
        usual = recording.up or up or rest_axis(motion.skeleton)
        places, rotations, rest = to_our_joints(motion, recording.unit, usual, reference)
    except DataError as error:
        raise DataError(str(error), path) from error
    if upward_axis(places, "z") != "z":  # ours is z
        tell(
            f"{recording.name}: nobody in it stands along its {usual} axis; if another one points "
            "up, say so with --up"
        )
    start = 0
    if reference is None:
        arms = rotations[:, [J["left_shoulder"], J["right_shoulder"]]]
        shoulders = rotations[:, [J["left_collar"], J["right_collar"]]]
        start = repair.missing_arm_frames(np.swapaxes(shoulders, -1, -2) @ arms)
    pieces: list[Piece] = []
    for first, last in repair.clean_pieces(places, fps, start, entry.glitch_at):
        if (last - first) * FPS < MIN_FRAMES * fps:
            continue
        p, r = resample(places[first:last], rotations[first:last], fps, FPS)
        name = f"{recording.name}.{len(pieces) + 1}" if pieces else recording.name
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
        raise DataError(f"no clean stretch of {MIN_FRAMES / FPS} s", path)
    return pieces
