"""The skeleton's one table: 52 bones with their names in five vocabularies (assets/skeleton.json).

Order and tree are those of SMPL-H: the root, 21 body joints, then 15 finger joints per hand,
parents before children. The same JSON is served to clients and shipped with each SDK.
"""

import json
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, Final

from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import ASSETS
from wayfarer.spec import JOINTS

SCHEMA: Final = 1
SKELETON_FILE: Final = ASSETS / "skeleton.json"


@dataclass(frozen=True, slots=True)
class Bone:
    """One bone. `parent` is None for the root only."""

    name: str  # canonical: SMPL-H / SMPL-X joint name
    parent: str | None
    mixamo: str  # without the "mixamorig:" prefix
    unity: str  # HumanBodyBones
    vrm: str  # VRM 1.0 humanoid
    ue: str  # UE4 Mannequin


@cache
def load_skeleton(path: Path = SKELETON_FILE) -> tuple[Bone, ...]:
    """The 52 bones in order. Raises ArtifactError when the file breaks its contract."""
    try:
        document = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read as JSON: {error}") from error
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        raise ArtifactError(f"{path}: expected an object with schema {SCHEMA}")
    rows = document.get("bones")
    if not isinstance(rows, list) or len(rows) != JOINTS:
        raise ArtifactError(f"{path}: bones: expected a list of {JOINTS}")
    bones = tuple(_bone(row, f"{path}: bones[{k}]") for k, row in enumerate(rows))
    _check_tree(bones, path)
    for column in ("name", "mixamo", "unity", "vrm", "ue"):
        names = [getattr(bone, column) for bone in bones]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ArtifactError(f"{path}: column {column}: {twice} occur more than once")
    return bones


def joint_names() -> tuple[str, ...]:
    """The canonical names of the 52 bones, in order."""
    return tuple(bone.name for bone in load_skeleton())


def bone_names(vocabulary: str) -> tuple[str, ...]:
    """The names of the 52 bones in a vocabulary (`clips.files.BoneNames`), in order."""
    column = "name" if vocabulary == "smpl" else vocabulary
    return tuple(getattr(bone, column) for bone in load_skeleton())


def parents() -> tuple[int, ...]:
    """The index of each bone's parent; -1 for the root."""
    names = joint_names()
    return tuple(-1 if b.parent is None else names.index(b.parent) for b in load_skeleton())


def mirrored(name: str) -> str:
    """The canonical name of the bone on the other side; a central bone is its own mirror image."""
    if name.startswith("left_"):
        return "right_" + name.removeprefix("left_")
    if name.startswith("right_"):
        return "left_" + name.removeprefix("right_")
    return name


def _bone(row: Any, where: str) -> Bone:
    expected = [field.name for field in fields(Bone)]
    if not isinstance(row, dict) or sorted(row) != sorted(expected):
        raise ArtifactError(f"{where}: expected an object with the fields {expected}")
    for column in expected:
        if not isinstance(row[column], str) and not (column == "parent" and row[column] is None):
            raise ArtifactError(f"{where}.{column}: expected a string, found {row[column]!r}")
    return Bone(**row)


def _check_tree(bones: tuple[Bone, ...], path: Path) -> None:
    seen: set[str | None] = {None}
    for k, bone in enumerate(bones):
        if bone.parent not in seen or (bone.parent is None) != (k == 0):
            raise ArtifactError(
                f"{path}: bones[{k}] {bone.name}: its parent {bone.parent!r} must stand before it, "
                "and only the first bone may have none"
            )
        seen.add(bone.name)
