"""From a file's skeleton to ours: which of its joints stands for each of our 22.

`SourceClip` is a motion in our conventions (metres, Z up, rest pose facing +Y, 40 fps), still
with the recorded person's proportions. Floor convention: z = 0 is the height of a standing
foot's ball joint, which the recording shows and its true sole does not.
"""

from dataclasses import dataclass, replace

import numpy as np

from wayfarer.body.skeleton import joint_names, mirrored, parents
from wayfarer.errors import DataError
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.mocap.skeleton import Array, MocapSkeleton, SkeletonMotion

JOINT_NAMES = joint_names()[:POSED_JOINTS]
J = {name: index for index, name in enumerate(JOINT_NAMES)}
PARENTS = np.array(parents()[:POSED_JOINTS])
MIRROR = np.array([J[mirrored(name)] for name in JOINT_NAMES])

# Ours → accepted names, best first: ASF, then BVH as MotionBuilder, Mixamo, LAFAN1 and 100STYLE
# write them. LeftShoulder is the upper arm where there is a LeftCollar, else the collar.
_SIDED = {
    "hip": "lfemur LeftUpLeg LeftHip LeftThigh",
    "knee": "ltibia LeftLeg LeftKnee LeftShin",
    "ankle": "lfoot LeftFoot LeftAnkle",
    "foot": "ltoes LeftToeBase LeftToe",
    "collar": "lclavicle LeftCollar LeftShoulder",
    "shoulder": "lhumerus LeftArm LeftUpArm LeftShoulder",
    "elbow": "lradius LeftForeArm LeftElbow LeftLowArm",
    "wrist": "lhand LeftFingerBase LeftHand LeftWrist",
}
_CENTRAL = {
    "pelvis": "root Hips Hip Pelvis",
    "neck": "lowerneck Neck",
    "head": "head Head",
}
_SPINES = (
    ("lowerback", "upperback", "thorax"),
    ("LowerBack", "Spine", "Spine1"),
    ("Spine", "Spine1", "Spine2"),
    ("Spine", "Spine1", "Spine1"),
    ("Spine", "Spine", "Spine"),
    ("Chest", "Chest2", "Chest4"),
    ("Chest", "Chest2", "Chest3"),
    ("Chest", "Chest", "Chest"),
)
METRES = (1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45)
"""Metres per unit that a file may use: m, cm, mm, inch, CMU's 1/0.45 inch."""
LEG = (0.6, 1.15)
"""Metres from hip to ankle that count as an adult's leg."""


def joint_map(skeleton: MocapSkeleton) -> list[int]:
    """Index of the file's joint for each of our 22. Raises DataError naming what is missing."""
    plain = {n.split(":")[-1].lower(): i for i, n in enumerate(skeleton.names)}
    if all(name in plain for name in JOINT_NAMES):  # SMPL's own names
        return [plain[name] for name in JOINT_NAMES]
    found: list[int] = []
    spine = next((s for s in _SPINES if all(n.lower() in plain for n in s)), None)
    for name in JOINT_NAMES:
        side, _, part = name.partition("_")
        if name.startswith("spine"):
            options = [spine[int(name[-1]) - 1]] if spine else ["Spine"]
        elif part:
            options = _SIDED[part].split()
            if side == "right":
                options = [o.replace("Left", "Right") for o in options]
                options[0] = "r" + options[0][1:]
        else:
            options = _CENTRAL[name].split()
        match = next((plain[o.lower()] for o in options if o.lower() in plain), None)
        if match is None or (part and match in found):
            raise DataError(f"no joint for {name}: expected one of {', '.join(options)}")
        found.append(match)
    return found


def axes_to_ours(rest: Array, up: str = "y") -> Array:
    """Rotation [3, 3] from file axes to ours, so that the zero pose faces +Y with Z up.

    `rest` [22, 3] are our joints in the file's zero pose. Raises DataError if that pose is not
    an upright one with the legs below the hips.
    """
    to_z_up = np.eye(3) if up == "z" else np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    turned = rest @ to_z_up.T
    legs = turned[[J["left_ankle"], J["right_ankle"]]] - turned[[J["left_hip"], J["right_hip"]]]
    if (legs[:, 2] > -0.7 * np.linalg.norm(legs, axis=1)).any():
        raise DataError(
            "the zero pose must stand upright (T- or A-pose) with its legs below the hips"
        )
    right = turned[J["right_hip"]] - turned[J["left_hip"]]
    angle = -np.arctan2(right[1], right[0])
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ to_z_up


def leg_length(places: Array) -> float:
    """Mean over both sides of thigh + shin, from joint places [22, 3]."""
    total = 0.0
    for side in ("left", "right"):
        hip, knee, ankle = (places[J[f"{side}_{part}"]] for part in ("hip", "knee", "ankle"))
        total += float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
    return total / 2


def guess_unit(rest: Array) -> float:
    """Metres per file unit, from the length of the legs. Raises DataError if none fits."""
    leg = leg_length(rest)
    fitting = [m for m in METRES if LEG[0] <= leg * m <= LEG[1]]
    if len(fitting) != 1:
        raise DataError(f"cannot tell the length unit from a leg of {leg:.3g} units: give --unit")
    return fitting[0]


@dataclass(frozen=True)
class ClipInfo:
    """Metadata of a clip."""

    name: str
    source: str  # clip it was cut or derived from
    subject: str
    split: str = "train"
    category: str = ""
    locomotion: bool = True
    scene_contact: bool = False
    augmentation: str = ""


@dataclass(frozen=True)
class SourceClip:
    """Joints of a recorded person, 40 fps, metres, Z up; z = 0 at the standing ball of the foot."""

    info: ClipInfo
    places: Array  # [N, 22, 3]
    rotations: Array  # [N, 22, 3, 3] world, relative to `rest`
    rest: Array  # [22, 3] zero pose, facing +Y
    contacts: Array  # [N, 2, 2] bool: left, right foot × heel, ball

    def __len__(self) -> int:
        return len(self.places)

    def cut(self, start: int, stop: int, **info: object) -> "SourceClip":
        """Frames start..stop, with some fields of `info` replaced."""
        return replace(
            self,
            info=replace(self.info, **info),  # type: ignore[arg-type]
            places=self.places[start:stop],
            rotations=self.rotations[start:stop],
            contacts=self.contacts[start:stop],
        )


def to_our_joints(
    motion: SkeletonMotion, unit: float | None, up: str
) -> tuple[Array, Array, Array]:
    """Places [N, 22, 3], world rotations [N, 22, 3, 3] and rest places [22, 3] in our frame."""
    rows = joint_map(motion.skeleton)
    rest = motion.skeleton.rest_places()[rows]
    metres = guess_unit(rest) if unit is None else unit
    turn = axes_to_ours(rest, up)
    rotations, places = motion.world()
    rest = rest * metres @ turn.T
    up_turn = np.eye(3) if up == "z" else np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    # world axes change by up_turn only (headings are kept as recorded), rest axes by turn
    return (
        places[:, rows] * metres @ up_turn.T,
        up_turn @ rotations[:, rows] @ turn.T,
        rest - rest[0],
    )
