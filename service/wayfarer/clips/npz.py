"""Clips as AMASS-style npz, the common exchange form of motion research.

Keys as in AMASS (https://amass.is.tue.mpg.de): `poses` [N, 156] rotation vectors of 52 joints in
SMPL-H order, `trans` [N, 3] metres, `betas`, `gender`, `mocap_framerate`. Our own: `contacts` [N,
2], `body`, `goals` [G, 3]. As in AMASS the world is Z up, while the T-pose of the body model is Y
up, facing +Z. `trans` moves the model, so the hips are at
trans + rest_hips, where rest_hips is given in the model's own (Y up) axes.
"""

from io import BytesIO
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from wayfarer.body.library import load_body
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import (
    GLTF_FROM_CORE,
    gltf_quaternion,
    matrix_from_quaternion,
    quaternion_from_matrix,
    quaternion_from_rotvec,
    rotvec_from_quaternion,
)
from wayfarer.clips.actor import Actor
from wayfarer.clips.clip import Clip
from wayfarer.errors import DataError, WayfarerError
from wayfarer.spec import GENDERS, JOINTS, POSED_JOINTS


def npz_bytes(actor: Actor) -> bytes:
    """The motion of one person, all of it in the hips."""
    clip, body = actor.clip, actor.body
    rotations = np.asarray(clip.rotations, np.float64)
    local = gltf_quaternion(rotations)
    # the root turns the Y-up model into the Z-up world
    root = matrix_from_quaternion(rotations[:, 0]) @ GLTF_FROM_CORE.T
    local[:, 0] = quaternion_from_matrix(root)
    poses = np.zeros((clip.frames, JOINTS, 3))
    poses[:, :POSED_JOINTS] = rotvec_from_quaternion(local)
    file = BytesIO()
    np.savez_compressed(
        file,
        poses=poses.reshape(clip.frames, -1),
        trans=clip.translation - _rest_hips(body, np.asarray(clip.betas)),
        betas=np.asarray(clip.betas, np.float64),
        gender=clip.gender,
        mocap_framerate=float(clip.fps),
        contacts=clip.contacts,
        body=clip.body,
        goals=np.asarray(clip.goals, np.float64).reshape(-1, 3),
    )
    return file.getvalue()


def read_npz(path: Path) -> Clip:
    """Reads an AMASS-style file, ours or AMASS's own (without fingers and contacts).

    A file that names no body gets anny52 of its gender, and keeps its motion, but not its shape.
    Raises DataError when the file does not fit.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {key: file[key] for key in file.files}
    except (OSError, ValueError, EOFError, BadZipFile) as error:
        raise DataError(f"not a readable npz file: {error}", str(path)) from error
    missing = {"poses", "trans", "mocap_framerate"} - set(data)
    if missing:
        raise DataError(f"keys {sorted(missing)} are missing; found {sorted(data)}", str(path))
    poses, trans = data["poses"], data["trans"]
    frames = len(poses)
    if poses.ndim != 2 or poses.shape[1] < POSED_JOINTS * 3 or trans.shape != (frames, 3):
        what = f"poses {poses.shape}, trans {trans.shape}; wanted [N, ≥ 66] and [N, 3]"
        raise DataError(what, str(path))

    told, name = str(data.get("gender", "")), str(data.get("body", ""))
    gender = told if told in GENDERS else GENDERS[0]  # AMASS knows "neutral" too
    body = load_body(name or "anny52", gender)
    betas = data["betas"][: body.betas] if name == body.name else np.zeros(body.betas)

    local = quaternion_from_rotvec(poses[:, : POSED_JOINTS * 3].reshape(frames, POSED_JOINTS, 3))
    root = matrix_from_quaternion(local[:, 0]) @ GLTF_FROM_CORE
    rotations = gltf_quaternion(local)
    rotations[:, 0] = quaternion_from_matrix(root)
    try:
        return Clip(
            translation=trans + _rest_hips(body, betas),
            rotations=rotations,
            contacts=data.get("contacts", np.zeros((frames, 2), bool)).astype(bool),
            gender=gender,
            betas=tuple(float(b) for b in betas),
            body=body.name,
            fps=float(data["mocap_framerate"]),
            goals=tuple(tuple(goal) for goal in data.get("goals", np.zeros((0, 3))).tolist()),
        )
    except WayfarerError as error:
        raise DataError(str(error), str(path)) from error


def _rest_hips(body: BodyModel, betas: np.ndarray) -> np.ndarray:
    """Hips of the T-pose in the model's own Y-up axes [3]."""
    return GLTF_FROM_CORE @ body.rest_joints(betas)[0]
