"""Readers for Acclaim ASF skeletons and AMC motions (the CMU database's original format).

An ASF bone is named by its end; here it becomes the joint at its start. With C the rotation
of the bone's `axis` line and M that of its dof values (`order` of the axis, last letter
applied first), a bone's rotation relative to its parent is C · M · C⁻¹.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.skeleton import (
    Array,
    MocapSkeleton,
    SkeletonMotion,
    euler_matrices,
)
from wayfarer_lab.training.mocap.text import read_text

INCH = 0.0254


@dataclass(frozen=True)
class AsfSkeleton:
    """An ASF file: the skeleton, and what its AMC files need to be read."""

    skeleton: MocapSkeleton
    dofs: tuple[tuple[str, ...], ...]  # J, degrees of freedom in file order, e.g. ("rx", "ry")
    axes: Array  # [J, 3, 3] C
    orders: tuple[str, ...]  # J, e.g. "ZYX" for the file's "XYZ"
    unit: float  # metres per file unit: the length unit is 1/length inch


@dataclass
class _Bone:
    name: str = ""
    direction: Array | None = None
    length: float | None = None
    axis: Array | None = None
    order: str = "XYZ"
    dofs: tuple[str, ...] = ()


def _numbers(words: list[str], count: int, what: str, path: str, line: int) -> Array:
    try:
        values = np.array([float(w) for w in words[:count]])
    except ValueError as error:
        raise DataError(f"{what}: {error}", path, line) from None
    if len(values) != count or not np.isfinite(values).all():
        raise DataError(f"{what} needs {count} finite numbers, got {words}", path, line)
    return values


def read_asf(text: str, path: str = "") -> AsfSkeleton:
    """Parses an ASF file. Raises DataError with the line that is wrong."""
    section, bones, bone = "", [], _Bone()
    hierarchy: list[tuple[str, list[str], int]] = []
    root_dofs: tuple[str, ...] = ("tx", "ty", "tz", "rx", "ry", "rz")
    root_axis, root_turn = "XYZ", np.zeros(3)
    length, degrees = 1.0, True
    for number, raw in enumerate(text.splitlines(), start=1):
        words = raw.split("#")[0].split()
        if not words:
            continue
        if words[0].startswith(":"):
            section = words[0]
            continue
        key = words[0].lower()
        if section == ":units":
            if key == "length":
                length = float(_numbers(words[1:], 1, "length", path, number)[0])
                if length <= 0:
                    raise DataError("length unit must be positive", path, number)
            elif key == "angle":
                degrees = words[1:2] != ["rad"]
        elif section == ":root":
            if key == "order":
                root_dofs = tuple(w.lower() for w in words[1:])
            elif key == "axis":
                root_axis = words[1]
            elif key == "orientation":
                root_turn = _numbers(words[1:], 3, "orientation", path, number)
        elif section == ":bonedata":
            if key == "begin":
                bone = _Bone()
            elif key == "name":
                bone.name = words[1]
            elif key == "direction":
                bone.direction = _numbers(words[1:], 3, "direction", path, number)
            elif key == "length":
                bone.length = float(_numbers(words[1:], 1, "length", path, number)[0])
            elif key == "axis":
                bone.axis = _numbers(words[1:], 3, "axis", path, number)
                bone.order = words[4] if len(words) > 4 else "XYZ"
            elif key == "dof":
                bone.dofs = tuple(w.lower() for w in words[1:])
                if not set(bone.dofs) <= {"rx", "ry", "rz"}:
                    raise DataError(f"dof may be rx, ry, rz, got {words[1:]}", path, number)
            elif key == "end":
                missing = [k for k in ("direction", "length", "axis") if getattr(bone, k) is None]
                if not bone.name or missing:
                    raise DataError(f"bone '{bone.name}' lacks {missing or 'name'}", path, number)
                bones.append(bone)
        elif section == ":hierarchy" and key not in ("begin", "end"):
            hierarchy.append((words[0], words[1:], number))
    if not bones or not hierarchy:
        raise DataError("no :bonedata or no :hierarchy section", path)
    if not degrees:
        raise DataError("angles in radians are not supported", path)
    if np.abs(root_turn).max() > 0:
        raise DataError("a root orientation other than 0 0 0 is not supported", path)
    return _assemble(bones, hierarchy, root_dofs, root_axis, INCH / length, path)


def _assemble(
    bones: list[_Bone],
    hierarchy: list[tuple[str, list[str], int]],
    root_dofs: tuple[str, ...],
    root_axis: str,
    unit: float,
    path: str,
) -> AsfSkeleton:
    """Order the bones parents first and move each from its end to its start."""
    by_name = {b.name: b for b in bones}
    names, parents, offsets = ["root"], [-1], [np.zeros(3)]
    for parent, children, number in hierarchy:
        for child in children:
            if child not in by_name or parent not in names or child in names:
                raise DataError(f"hierarchy: cannot hang '{child}' on '{parent}'", path, number)
            names.append(child)
            parents.append(names.index(parent))
            above = by_name.get(parent)
            tip = np.zeros(3)
            if above is not None and above.direction is not None and above.length is not None:
                tip = above.direction * above.length
            offsets.append(tip)
    tips = {
        n: np.asarray(by_name[n].direction) * float(by_name[n].length or 0.0)
        for j, n in enumerate(names)
        if j > 0 and j not in parents
    }
    axes = [np.zeros(3)] + [np.asarray(by_name[n].axis) for n in names[1:]]
    orders = [root_axis[::-1].upper()] + [by_name[n].order[::-1].upper() for n in names[1:]]
    return AsfSkeleton(
        skeleton=MocapSkeleton(tuple(names), tuple(parents), np.array(offsets), tips),
        dofs=(root_dofs, *(by_name[n].dofs for n in names[1:])),
        axes=np.stack(
            [euler_matrices(_ordered(a, o), o) for a, o in zip(axes, orders, strict=True)]
        ),
        orders=tuple(orders),
        unit=unit,
    )


def _ordered(xyz: Array, order: str) -> Array:
    """Angles about x, y, z in the order in which `euler_matrices` takes them."""
    return xyz[["XYZ".index(axis) for axis in order]]


def read_amc(text: str, asf: AsfSkeleton, path: str = "") -> SkeletonMotion:
    """Parses an AMC motion of this skeleton. Raises DataError with the line that is wrong.

    AMC files do not state their frame rate: `fps` is None.
    """
    width = {n: len(d) for n, d in zip(asf.skeleton.names, asf.dofs, strict=True)}
    start = dict(zip(width, np.cumsum([0, *width.values()])[:-1].tolist(), strict=True))
    expected = {n for n, w in width.items() if w}
    size = sum(width.values())
    rows: list[list[float]] = []
    row: list[float] = []
    seen: set[str] = set()
    for number, raw in enumerate(text.splitlines(), start=1):
        words = raw.split()
        if not words or raw[0] in "#:":
            continue
        name = words[0]
        if len(words) == 1 and name.isdigit():
            if rows and seen != expected:
                missing = sorted(expected - seen)
                raise DataError(f"frame {len(rows)} lacks {missing}", path, number - 1)
            row, seen = [0.0] * size, set()
            rows.append(row)
            continue
        if not rows:
            raise DataError(f"expected a frame number, got '{name}'", path, number)
        if name not in expected:
            raise DataError(f"the skeleton has no moving bone '{name}'", path, number)
        try:
            values = [float(w) for w in words[1:]]
        except ValueError as error:
            raise DataError(f"bone '{name}': {error}", path, number) from None
        if len(values) != width[name]:
            message = f"bone '{name}' needs {width[name]} numbers, got {len(values)}"
            raise DataError(message, path, number)
        row[start[name] : start[name] + len(values)] = values
        seen.add(name)
    if not rows:
        raise DataError("no frames", path)
    if seen != expected:
        rows.pop()  # a copy cut off in its last frame is common; the frames before are whole
    table = np.array(rows)
    if not len(table) or not np.isfinite(table).all():
        raise DataError("no whole frame, or a value that is not finite", path)
    return _motion(table, asf, start)


def _motion(table: Array, asf: AsfSkeleton, start: dict[str, int]) -> SkeletonMotion:
    frames, names = len(table), asf.skeleton.names
    root = np.zeros((frames, 3))
    local = np.broadcast_to(np.eye(3), (frames, len(names), 3, 3)).copy()
    for j, name in enumerate(names):
        angles = np.zeros((frames, 3))  # in the order of `orders`
        for k, dof in enumerate(asf.dofs[j]):
            column = table[:, start[name] + k]
            if dof[0] == "t":
                root[:, "xyz".index(dof[1])] = column
            elif dof[0] == "r":
                angles[:, asf.orders[j].index(dof[1].upper())] = column
        c = asf.axes[j]
        local[:, j] = c @ euler_matrices(angles, asf.orders[j]) @ c.T
    return SkeletonMotion(asf.skeleton, root, local, None)


def load_asf(path: Path) -> AsfSkeleton:
    """Reads an ASF file from disk."""
    return read_asf(read_text(path), str(path))
