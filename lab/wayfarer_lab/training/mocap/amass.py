"""AMASS files: SMPL body parameters as a motion on the recorded person's own skeleton.

Two layouts of `.npz` are read: SMPL+H (`*_poses.npz`: `poses` [N, 156], `mocap_framerate`) and
SMPL-X (`*_stageii.npz`: `poses` [N, 165], `mocap_frame_rate`, `surface_model_type`); both have
`trans` [N, 3], `betas` and `gender`. Only root and body joints of the poses are used. Nothing
pickled is read: the layouts keep notes in pickled arrays, which are not opened.

Frames: the world is Z up, the body of the zero pose Y up, which a root rotation turns upright.
`trans` moves the mesh, whose root joint is not at its origin: hips = trans + joint 0 of the shape.
"""

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast
from zipfile import BadZipFile

import numpy as np

from wayfarer.body.skeleton import joint_names, parents
from wayfarer.errors import DataError
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.mocap.skeleton import Array, MocapSkeleton, SkeletonMotion
from wayfarer_lab.training.smpl_joints import Layout, find_model, load_joints

SUFFIX = ".npz"
ENDINGS = ("_poses", "_stageii")
"""Ends of the names of motion files."""
NO_MOTION = ("shape", "_stagei")
"""Ends of the names of files that hold a subject's shape alone."""

_LAYOUTS: Mapping[int, Layout] = {156: "smplh", 165: "smplx"}
_UNREADABLE = (OSError, ValueError, EOFError, BadZipFile, zlib.error)
_RATES = ("mocap_framerate", "mocap_frame_rate", "fps")
"""Names under which sets of this layout keep the rate."""
_SAME_RATE = 0.01
"""Fraction by which two rates of one file may differ, by rounding."""
_Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def read_amass(path: Path, models: Path | None) -> SkeletonMotion:
    """A motion in metres, Y up, with our 22 joints by their own names.

    `models` is the user's folder of body models (`smpl_joints.PLACES`).

    Raises:
        DataError: the file has neither layout; the error names the array and what was expected.
        ArtifactError: the body model is missing or is not one.
    """
    # imported here: scipy comes with the `train` extra
    from scipy.spatial.transform import Rotation

    try:
        file = np.load(path, allow_pickle=False)
    except _UNREADABLE as error:
        raise DataError(f"cannot be read as npz: {error}", str(path)) from error
    if not isinstance(file, np.lib.npyio.NpzFile):
        raise DataError("is a single array, expected AMASS parameters", str(path))
    with file:
        poses = _numbers(path, file, "poses", ndim=2)
        places = _numbers(path, file, "trans", ndim=2)
        betas = _numbers(path, file, "betas", ndim=1)
        layout = _layout(path, file, poses.shape[1])
        gender = _text(path, file, "gender")
        fps = _rate(path, file)
    if places.shape != (len(poses), 3):
        raise DataError(f"trans has shape {places.shape}, expected ({len(poses)}, 3)", str(path))
    if gender not in ("male", "female", "neutral"):
        raise DataError(f"gender is {gender!r}, expected male, female or neutral", str(path))
    rest = load_joints(find_model(models, layout, gender), layout).rest(betas)
    turns = poses[:, : POSED_JOINTS * 3].reshape(-1, 3)
    local = Rotation.from_rotvec(turns).as_matrix().reshape(-1, POSED_JOINTS, 3, 3)
    local[:, 0] = _Y_UP @ local[:, 0]
    tree = parents()[:POSED_JOINTS]
    offsets = np.array([rest[j] - rest[max(p, 0)] for j, p in enumerate(tree)])
    skeleton = MocapSkeleton(joint_names()[:POSED_JOINTS], tuple(tree), offsets, {})
    return SkeletonMotion(skeleton, (places + rest[0]) @ _Y_UP.T, local, fps)


def _layout(path: Path, file: Mapping[str, Any], columns: int) -> Layout:
    """By the width of the poses, with which the file's own word must agree where it has one."""
    found = _LAYOUTS.get(columns)
    said = _text(path, file, "surface_model_type") if "surface_model_type" in file else found
    if found is None or said != found:
        raise DataError(
            f"poses have {columns} numbers a frame{f' of {said}' if said else ''}, expected 156 "
            "(smplh) or 165 (smplx): download AMASS as SMPL+H G or as SMPL-X",
            str(path),
        )
    return found


def _rate(path: Path, file: Mapping[str, Any]) -> float:
    rates = {n: _rate_of(path, file, n) for n in _RATES if n in file}
    if not rates:
        raise DataError(f"has no {' or '.join(_RATES)}; it has {sorted(file)}", str(path))
    if max(rates.values()) > min(rates.values()) * (1 + _SAME_RATE):
        said = ", ".join(f"{name} {rate:g}" for name, rate in rates.items())
        raise DataError(
            f"two frame rates contradict each other: {said}; keep the right one alone", str(path)
        )
    return next(iter(rates.values()))


def _rate_of(path: Path, file: Mapping[str, Any], name: str) -> float:
    rate = _numbers(path, file, name, ndim=None)
    if rate.size != 1 or rate.item() <= 0:
        raise DataError(f"{name} is {rate.tolist()}, expected one positive number", str(path))
    return float(rate.item())


def _numbers(path: Path, file: Mapping[str, Any], name: str, ndim: int | None) -> Array:
    values = _array(path, file, name)
    if ndim is None:  # numbers of any shape
        ndim = values.ndim
    if values.ndim != ndim or not np.issubdtype(values.dtype, np.number) or not values.size:
        raise DataError(
            f"array {name} is {values.dtype} {values.shape}, expected numbers, {ndim} axes",
            str(path),
        )
    if not np.isfinite(values).all():
        raise DataError(f"array {name} has values that are not finite", str(path))
    return values.astype(np.float64)


def _text(path: Path, file: Mapping[str, Any], name: str) -> str:
    values = _array(path, file, name)
    if values.ndim or values.dtype.kind not in "US":
        raise DataError(
            f"array {name} is {values.dtype} {values.shape}, expected a word", str(path)
        )
    word = values.item()
    return word.decode("ascii", "replace") if isinstance(word, bytes) else cast(str, word)


def _array(path: Path, file: Mapping[str, Any], name: str) -> Array:
    if name not in file:
        raise DataError(f"array {name} is missing; found {sorted(file)}", str(path))
    try:
        return np.asarray(file[name])
    except _UNREADABLE as error:
        raise DataError(f"array {name} is pickled or damaged: {error}", str(path)) from error
