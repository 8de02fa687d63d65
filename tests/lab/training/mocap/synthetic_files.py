"""Motion files written from a motion: BVH with any zero pose, FBX as text."""

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from wayfarer_lab.training.mocap.skeleton import MocapSkeleton, SkeletonMotion

FBX_SECOND = 46186158000  # its unit of time


def with_axes(motion: SkeletonMotion, axes: np.ndarray) -> SkeletonMotion:
    """The same places on a skeleton whose joints have other axes [J, 3, 3] in the zero pose."""
    offsets, local = motion.skeleton.offsets.copy(), motion.local.copy()
    for j, parent in enumerate(motion.skeleton.parents):
        local[:, j] = motion.local[:, j] @ axes[j]
        if parent >= 0:
            offsets[j] = axes[parent].T @ offsets[j]
            local[:, j] = axes[parent].T @ local[:, j]
    skeleton = MocapSkeleton(motion.skeleton.names, motion.skeleton.parents, offsets, {})
    return SkeletonMotion(skeleton, motion.root, local, motion.fps)


def bones_along_y(motion: SkeletonMotion) -> np.ndarray:
    """Axes [J, 3, 3] of joints whose y points at their first child, as Blender and ACCAD have."""
    parents, offsets = motion.skeleton.parents, motion.skeleton.offsets
    axes = np.tile(np.eye(3), (len(parents), 1, 1))
    for j in range(len(parents)):
        child = next((k for k, p in enumerate(parents) if p == j), None)
        if child is not None:
            bone = offsets[child] / np.linalg.norm(offsets[child])
            axes[j] = Rotation.align_vectors(bone[None], [[0.0, 1, 0]])[0].as_matrix()
    return axes


def bvh_of(motion: SkeletonMotion) -> str:
    """A BVH file of a motion; joints whose offset moves have position channels."""
    names, parents = motion.skeleton.names, motion.skeleton.parents
    lines, order = ["HIERARCHY"], []

    def write(j: int) -> None:
        order.append(j)
        lines.append(f"{'JOINT' if parents[j] >= 0 else 'ROOT'} {names[j]}")
        offset = motion.skeleton.offsets[j] if parents[j] >= 0 else np.zeros(3)
        lines.extend(["{", "OFFSET " + " ".join(f"{v:.9f}" for v in offset)])
        moves = parents[j] < 0 or j in motion.shifts
        places = "Xposition Yposition Zposition " if moves else ""
        lines.append(f"CHANNELS {6 if moves else 3} {places}Zrotation Yrotation Xrotation")
        children = [k for k, parent in enumerate(parents) if parent == j]
        for k in children:
            write(k)
        lines.extend([] if children else ["End Site", "{", "OFFSET 0 1 0", "}"])
        lines.append("}")

    write(0)
    angles = Rotation.from_matrix(motion.local.reshape(-1, 3, 3)).as_euler("ZYX", degrees=True)
    angles = angles.reshape(len(motion), len(names), 3)
    columns = []
    for j in order:
        if parents[j] < 0:
            columns.append(motion.root)
        elif j in motion.shifts:
            columns.append(motion.shifts[j])
        columns.append(angles[:, j])
    table = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(motion)}", f"Frame Time: {1 / motion.fps:.8f}"]
    lines += [" ".join(f"{v:.8f}" for v in row) for row in table]
    return "\n".join(lines) + "\n"


def fbx_of(
    takes: dict[str, SkeletonMotion],
    *,
    above: tuple[tuple[str, str], ...] = (),
    up: int = 1,
    unit: float = 1.0,
    prefix: str = "",
    saved: int | None = None,
    bind: SkeletonMotion | None = None,
    rate: float | None = None,
) -> str:
    """An ASCII FBX 7.4 file of takes on one skeleton.

    `above`: nodes above the root with their properties, top first. `up`: 1 for Y, 2 for Z.
    `unit`: centimetres per unit. `saved`: frame of the first take in which the file was saved;
    None: all rotations zero. `bind`: its first frame is the bind pose. `rate`: that is declared.
    """
    first = next(iter(takes.values()))
    names = [prefix + name for name in first.skeleton.names]
    parents = first.skeleton.parents
    ids = {name: 1000 + k for k, name in enumerate([*(n for n, _ in above), *names])}
    objects, links = [], []
    for name, _ in above[:1]:
        links.append((ids[name], 0))
    links += [(ids[b], ids[a]) for (a, _), (b, _) in pairwise(above)]
    objects += [_model(ids[name], name, "Null", properties) for name, properties in above]
    for j, name in enumerate(names):
        top = ids[above[-1][0]] if above else 0
        links.append((ids[name], ids[names[parents[j]]] if parents[j] >= 0 else top))
        place, turn = first.skeleton.offsets[j], np.zeros(3)
        if parents[j] < 0:
            place = first.root[saved or 0]
        if saved is not None:
            turn = _euler(first.local[saved : saved + 1, j])[0]
        properties = _property("Lcl Translation", place) + _property("Lcl Rotation", turn)
        objects.append(_model(ids[name], name, "LimbNode", properties))
    number = 10_000
    for take, motion in takes.items():
        stack, layer = number, number + 1
        number += 2
        objects.append(f'AnimationStack: {stack}, "AnimStack::{take}", "" {{\n}}')
        objects.append(f'AnimationLayer: {layer}, "AnimLayer::{take}", "" {{\n}}')
        links.append((layer, stack))
        for j, name in enumerate(names):
            curves = {"Lcl Rotation": _euler(motion.local[:, j])}
            if parents[j] < 0 or j in motion.shifts:
                curves["Lcl Translation"] = motion.root if parents[j] < 0 else motion.shifts[j]
            for what, values in curves.items():
                node = number
                objects.append(f'AnimationCurveNode: {node}, "AnimCurveNode::T", "" {{\n}}')
                links += [(node, layer), (node, ids[name], what)]
                for k, axis in enumerate("XYZ"):
                    objects.append(_curve(node + 1 + k, values[:, k], motion.fps))
                    links.append((node + 1 + k, node, f"d|{axis}"))
                number += 4
    if bind is not None:
        objects.append(_bind_pose(number, ids, names, bind))
    mode = "" if rate is None else 'P: "TimeMode", "enum", "", "",14\n'
    mode += "" if rate is None else f'P: "CustomFrameRate", "double", "Number", "",{rate}\n'
    joined = "\n".join(
        f'C: "{"OP" if len(link) == 3 else "OO"}",{link[0]},{link[1]}'
        + (f', "{link[2]}"' if len(link) == 3 else "")
        for link in links
    )
    front, sign = (2, 1) if up == 1 else (1, -1)
    return (
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {\nFBXVersion: 7400\n}\n"
        "GlobalSettings: {\nVersion: 1000\nProperties70: {\n"
        f'P: "UpAxis", "int", "Integer", "",{up}\nP: "UpAxisSign", "int", "Integer", "",1\n'
        f'P: "FrontAxis", "int", "Integer", "",{front}\n'
        f'P: "FrontAxisSign", "int", "Integer", "",{sign}\n'
        'P: "CoordAxis", "int", "Integer", "",0\nP: "CoordAxisSign", "int", "Integer", "",1\n'
        f'P: "UnitScaleFactor", "double", "Number", "",{unit}\n{mode}}}\n}}\n'
        "Objects: {\n" + "\n".join(objects) + "\n}\nConnections: {\n" + joined + "\n}\n"
    )


def _euler(matrices: np.ndarray) -> np.ndarray:
    """Angles X, Y, Z in degrees as FBX has them: X is applied first. Without leaps over ±180."""
    angles = Rotation.from_matrix(matrices).as_euler("xyz")
    return np.rad2deg(np.unwrap(angles, axis=0))


def _property(name: str, values: np.ndarray) -> str:
    return f'P: "{name}", "{name}", "", "A",' + ",".join(f"{v:.9f}" for v in values) + "\n"


def _model(number: int, name: str, kind: str, properties: str) -> str:
    head = f'Model: {number}, "Model::{name}", "{kind}" {{\nVersion: 232\n'
    return head + f"Properties70: {{\n{properties}}}\n}}"


def _curve(number: int, values: np.ndarray, fps: float) -> str:
    times = ",".join(str(round(k * FBX_SECOND / fps)) for k in range(len(values)))
    floats = ",".join(f"{v:.9f}" for v in values)
    count = len(values)
    return (
        f'AnimationCurve: {number}, "AnimCurve::", "" {{\nDefault: 0\nKeyVer: 4008\n'
        f"KeyTime: *{count} {{\na: {times}\n}}\nKeyValueFloat: *{count} {{\na: {floats}\n}}\n"
        "KeyAttrFlags: *1 {\na: 4\n}\nKeyAttrDataFloat: *4 {\na: 0,0,0,0\n}\n"
        f"KeyAttrRefCount: *1 {{\na: {count}\n}}\n}}"
    )


def _bind_pose(number: int, ids: dict[str, int], names: list[str], bind: SkeletonMotion) -> str:
    rotations, places = bind.world()
    parts = [f'Pose: {number}, "Pose::BIND", "BindPose" {{\nType: "BindPose"\nVersion: 100']
    parts.append(f"NbPoseNodes: {len(names)}")
    for j, name in enumerate(names):
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotations[0, j], places[0, j]
        values = ",".join(f"{v:.9f}" for v in matrix.T.ravel())
        parts.append(f"PoseNode: {{\nNode: {ids[name]}\nMatrix: *16 {{\na: {values}\n}}\n}}")
    return "\n".join([*parts, "}"])
