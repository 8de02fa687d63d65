"""Small motion files and clips, made by formula."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from wayfarer.spec import FPS, POSED_JOINTS
from wayfarer_lab.training.mocap.rig import ClipInfo, J, SourceClip

# name, parent, offset in centimetres; Y up, facing +Z, left is +X
BVH_JOINTS = [
    ("Hips", None, (0, 0, 0)),
    ("LeftUpLeg", "Hips", (10, -5, 0)),
    ("LeftLeg", "LeftUpLeg", (0, -42, 0)),
    ("LeftFoot", "LeftLeg", (0, -42, 0)),
    ("LeftToeBase", "LeftFoot", (0, -5, 13)),
    ("RightUpLeg", "Hips", (-10, -5, 0)),
    ("RightLeg", "RightUpLeg", (0, -42, 0)),
    ("RightFoot", "RightLeg", (0, -42, 0)),
    ("RightToeBase", "RightFoot", (0, -5, 13)),
    ("Spine", "Hips", (0, 10, 0)),
    ("Spine1", "Spine", (0, 12, 0)),
    ("Spine2", "Spine1", (0, 12, 0)),
    ("Neck", "Spine2", (0, 18, 0)),
    ("Head", "Neck", (0, 9, 0)),
    ("LeftShoulder", "Spine2", (5, 12, 0)),
    ("LeftArm", "LeftShoulder", (13, 0, 0)),
    ("LeftForeArm", "LeftArm", (28, 0, 0)),
    ("LeftHand", "LeftForeArm", (25, 0, 0)),
    ("RightShoulder", "Spine2", (-5, 12, 0)),
    ("RightArm", "RightShoulder", (-13, 0, 0)),
    ("RightForeArm", "RightArm", (-28, 0, 0)),
    ("RightHand", "RightForeArm", (-25, 0, 0)),
]
BVH_COLUMNS = 3 + 3 * len(BVH_JOINTS)


def standing_rows(frames: int) -> np.ndarray:
    """Somebody stands, arms hanging and swinging a little. [frames, BVH_COLUMNS]"""
    rows = np.zeros((frames, BVH_COLUMNS))
    rows[:, 1] = 100.0
    names = [n for n, *_ in BVH_JOINTS]
    swing = 3 * np.sin(np.linspace(0, 6, frames))
    for side, sign in (("Left", -1), ("Right", 1)):
        rows[:, 3 + 3 * names.index(f"{side}Arm")] = sign * 75 + swing  # about Z
    return rows


def bvh_text(rows: np.ndarray, fps: float = 120.0, newline: str = "\n") -> str:
    lines = ["HIERARCHY"]

    def write(name: str, parent: str | None, offset: tuple[float, ...]) -> None:
        lines.append(f"{'JOINT' if parent else 'ROOT'} {name}")
        lines.append("{")
        lines.append("OFFSET " + " ".join(map(str, offset)))
        turns = "Zrotation Yrotation Xrotation"
        lines.append(
            f"CHANNELS 3 {turns}" if parent else f"CHANNELS 6 Xposition Yposition Zposition {turns}"
        )
        children = [j for j in BVH_JOINTS if j[1] == name]
        for child in children:
            write(*child)
        if not children:
            lines.extend(["End Site", "{", "OFFSET 0 0 5", "}"])
        lines.append("}")

    write(*BVH_JOINTS[0])
    lines += ["MOTION", f"Frames: {len(rows)}", f"Frame Time: {1 / fps:.8f}"]
    lines += [" ".join(f"{v:.6f}" for v in row) for row in rows]
    return newline.join(lines) + newline


ASF = """\
:version 1.10
:units
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name upper
    direction 1 0 0
    length 2
    axis 10 20 30 XYZ
    dof rx ry rz
  end
  begin
    id 2
    name lower
    direction 0 -1 0
    length 3
    axis 0 0 40 XYZ
    dof rx
  end
  begin
    id 3
    name tip
    direction 0 0 1
    length 1
    axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root upper
    upper lower
    lower tip
  end
"""
AMC = """\
#!comment
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 20 30
upper 15 25 35
lower 45
2
root 1 2 4 0 0 0
upper 0 0 0
lower 0
"""


def stepping(frames: int = 160, speed: float = 1.0, step: int = 20) -> SourceClip:
    """Straight walking along +Y in which feet, standing in turn, do not move at all.

    Geometry only: joints above the feet ride along upright. Rest pose facing +Y.
    """
    rest = np.zeros((POSED_JOINTS, 3))
    side = {"left": -0.1, "right": 0.1}
    heights = {"hip": 0.85, "knee": 0.45, "ankle": 0.05, "foot": 0.0, "collar": 1.3}
    heights |= {"shoulder": 1.3, "elbow": 1.05, "wrist": 0.8}
    for name, j in J.items():
        left, _, part = name.partition("_")
        if part:
            rest[j] = (side[left], 0.13 if part == "foot" else 0.0, heights[part])
    for name, z in (("pelvis", 0.9), ("spine1", 1.0), ("spine2", 1.1), ("spine3", 1.2)):
        rest[J[name], 2] = z
    rest[J["neck"], 2], rest[J["head"], 2] = 1.4, 1.5
    places = np.tile(rest, (frames, 1, 1))
    y = speed * np.arange(frames) / FPS
    places[..., 1] += y[:, None]
    contacts = np.zeros((frames, 2, 2), bool)
    stride = 2 * step * speed / FPS
    for foot, name in enumerate(("left", "right")):
        phase = (np.arange(frames) + foot * step) / (2 * step)
        whole, part = np.floor(phase), phase % 1
        swing = np.clip((part - 0.6) / 0.4, 0, 1)
        at = (whole + swing * swing * (3 - 2 * swing)) * stride + (0.3 - foot * 0.5) * stride
        for joint in ("ankle", "foot"):
            places[:, J[f"{name}_{joint}"], 1] = at + rest[J[f"{name}_{joint}"], 1]
            places[:, J[f"{name}_{joint}"], 2] += 0.1 * np.sin(np.pi * swing)
        contacts[:, foot] = (part <= 0.6)[:, None]
    rotations = np.broadcast_to(np.eye(3), (frames, POSED_JOINTS, 3, 3)).copy()
    return SourceClip(ClipInfo("walk", "walk", "s"), places, rotations, rest, contacts)


def edited(text: str, line: int, change: Callable[[str], str]) -> str:
    """The text with one line (1-based) changed."""
    lines = text.split("\n")
    lines[line - 1] = change(lines[line - 1])
    return "\n".join(lines)


# SMPL's rest pose: Y up, facing +Z, left is +X, origin near the chest, as in the model files.
AMASS_REST = np.array(
    [
        *([0, -35, 1], [6, -44, 0], [-6, -44, 0], [0, -24, 0], [10, -82, 0], [-10, -82, 0]),
        *([0, -10, 0], [9, -123, -2], [-9, -123, -2], [0, -4, 1], [12, -128, 10]),
        *([-12, -128, 10], [0, 12, -1], [5, 8, -1], [-5, 8, -1], [0, 18, 2], [16, 9, -2]),
        *([-16, 9, -2], [42, 8, -3], [-42, 8, -3], [67, 9, -4], [-67, 9, -4]),
    ]
)
AMASS_REST = AMASS_REST / 100  # metres


def write_smpl(folder: Path, layout: str, gender: str) -> Path:
    """A body model of which joints alone are true, with arrays as in the real files."""
    joints, rng = {"smplx": 55, "smplh": 52}[layout], np.random.default_rng(3)
    vertices = np.concatenate([AMASS_REST, rng.normal(size=(joints + 20 - 22, 3))])
    place = f"SMPLX_{gender.upper()}.npz" if layout == "smplx" else f"smplh/{gender}/model.npz"
    path = folder / place
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(
        path,
        v_template=vertices,
        shapedirs=rng.normal(0, 0.003, (len(vertices), 3, 20 if layout == "smplx" else 16)),
        J_regressor=np.eye(joints, len(vertices)),
        kintree_table=np.zeros((2, joints), np.int64),
        bs_style=np.array({"pickled": 1}, dtype=object),
    )
    return path


def amass_arrays(layout: str, frames: int, fps: float) -> dict[str, np.ndarray]:
    """Somebody stands, turned upright from Y up to Z up; arms hang and swing a little."""
    poses = np.zeros((frames, {"smplh": 156, "smplx": 165}[layout]))
    poses[:, 0] = np.pi / 2
    swing = 0.05 * np.sin(np.linspace(0, 6, frames))
    for joint, sign in ((J["left_shoulder"], -1), (J["right_shoulder"], 1)):
        poses[:, 3 * joint + 2] = sign * 1.45 + swing
    arrays = {
        "trans": np.tile([2.0, 1.0, 1.28], (frames, 1)),
        "poses": poses,
        "betas": np.zeros(16),
        "gender": np.array("male" if layout == "smplx" else b"male"),
    }
    if layout == "smplh":
        return arrays | {"mocap_framerate": np.array(fps), "dmpls": np.zeros((frames, 8))}
    return arrays | {
        "mocap_frame_rate": np.array(fps),
        "surface_model_type": np.array("smplx"),
        "markers_latent_vids": np.array({"pickled": 1}, dtype=object),
        "num_betas": np.array(16),
    }


def write_amass(path: Path, arrays: dict[str, np.ndarray]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **arrays)
    return path
