"""Which joint of a file stands for each of our 22."""

from wayfarer.characters.bone_map import map_bones
from wayfarer.characters.rig import Node, Rig
from wayfarer.errors import DataError, InvalidArgument
from wayfarer_lab.training.mocap.rig import JOINT_NAMES
from wayfarer_lab.training.mocap.skeleton import MocapSkeleton

# Ours → accepted names, best first: ASF, then as MotionBuilder, Mixamo, LAFAN1, 100STYLE and Motive
# write them. LeftShoulder is the upper arm where there is a LeftCollar, otherwise the collar.
_SIDED = {
    "hip": "lfemur LeftUpLeg LeftHip LeftThigh LThigh",
    "knee": "ltibia LeftLeg LeftKnee LeftShin LShin",
    "ankle": "lfoot LeftFoot LeftAnkle LFoot",
    "foot": "ltoes LeftToeBase LeftToe LToe",
    "collar": "lclavicle LeftCollar LeftShoulder LShoulder",
    "shoulder": "lhumerus LeftArm LeftUpArm LeftShoulder LUArm",
    "elbow": "lradius LeftForeArm LeftElbow LeftLowArm LFArm",
    "wrist": "lhand LeftFingerBase LeftHand LeftWrist LHand",
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
    ("Ab", "Chest", "Chest"),
    ("Chest", "Chest", "Chest"),
)


def joint_map(skeleton: MocapSkeleton) -> list[int]:
    """Index of the file's joint for each of our 22.

    Names of recording systems come first, then those by which bones of characters are found
    (clients/README.md). Raises DataError naming what is missing.
    """
    plain = {n.split(":")[-1].lower(): i for i, n in enumerate(skeleton.names)}
    if all(name in plain for name in JOINT_NAMES):  # SMPL's own names
        return [plain[name] for name in JOINT_NAMES]
    try:
        return _by_systems(plain)
    except DataError as error:
        found = _by_characters(skeleton)
        if found is None:
            raise error
        return found


def _by_systems(plain: dict[str, int]) -> list[int]:
    """Joints by the names of `_SIDED`, `_CENTRAL` and `_SPINES`; `plain` is lower case."""
    found: list[int] = []
    spine = next((s for s in _SPINES if all(n.lower() in plain for n in s)), None)
    for name in JOINT_NAMES:
        side, _, part = name.partition("_")
        if name.startswith("spine"):
            options = [spine[int(name[-1]) - 1]] if spine else ["Spine"]
        elif part:
            options = _SIDED[part].split()
            if side == "right":
                options = [_right(option) for option in options]
        else:
            options = _CENTRAL[name].split()
        match = next((plain[o.lower()] for o in options if o.lower() in plain), None)
        if match is None or (part and match in found):
            raise DataError(f"no joint for {name}: expected one of {', '.join(options)}")
        found.append(match)
    return found


def _right(name: str) -> str:
    if name.startswith("Left"):
        return "Right" + name[4:]
    return ("r" if name[0] == "l" else "R") + name[1:]


def _by_characters(skeleton: MocapSkeleton) -> list[int] | None:
    """By the words of characters' bones, if they tell all 22; a spine may be shorter."""
    nodes = (
        Node(name, parent, offset)
        for name, parent, offset in zip(
            skeleton.names, skeleton.parents, skeleton.offsets.tolist(), strict=True
        )
    )
    try:
        mapped = map_bones(Rig(tuple(nodes)))
    except InvalidArgument:
        return None
    bones = dict(mapped.bones)
    for above, below in (("spine2", "spine3"), ("spine1", "spine2")):
        if below in bones:
            bones.setdefault(above, bones[below])
    if mapped.found_by != "names" or any(name not in bones for name in JOINT_NAMES):
        return None
    return [bones[name] for name in JOINT_NAMES]
