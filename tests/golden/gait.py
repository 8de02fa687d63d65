"""One stride and a stand, from the walk in walk.json, as tables in the languages of the clients."""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.skeleton import load_skeleton
from wayfarer_client.quaternions import multiply, slerp

HERE = Path(__file__).parent
CLIENTS = HERE.parents[1] / "clients"
MADE = "// Written by `python -m tests.golden` from tests/golden/walk.json.\n"

POSES: Final = 16
STRIDE: Final = 22
"""Frames of the walk that make a stride; at both ends the right leg is farthest forward."""
STANDING: Final = slice(44, 48)
"""Frames in which it stands."""
MIRRORED: Final = np.array([1.0, -1.0, -1.0, 1.0])
"""A rotation in the glTF basis, seen in a mirror across the body."""

Array = NDArray[np.float64]


def table() -> dict[str, Any]:
    """`stand` [22][4], `cycle` [16][22][4], `swing` of the cycle."""
    walk = json.loads((HERE / "walk.json").read_text())
    rotations = np.array(walk["rotations"]).reshape(-1, 22, 4)
    stride = rotations[: STRIDE + 1].copy()
    stride[:, 0] = [_without_heading(turn, stride[:, 0]) for turn in stride[:, 0]]
    ends = [
        multiply(first, _inverse(last)) for first, last in zip(stride[0], stride[-1], strict=True)
    ]
    for bone, off in enumerate(ends):
        for frame in range(STRIDE + 1):
            part = slerp(np.array([0.0, 0.0, 0.0, 1.0]), off, frame / STRIDE)
            stride[frame, bone] = multiply(part, stride[frame, bone])
    half = (np.arange(POSES) / POSES + 0.5) % 1 * STRIDE
    cycle = np.array(
        [slerp(stride[int(at)], stride[int(at) + 1], at - int(at)) for at in half], float
    )
    cycle = _mean(cycle, _mirror(np.roll(cycle, POSES // 2, axis=0)))
    still = rotations[STANDING].copy()
    still[:, 0] = [_without_heading(turn, still[:, 0]) for turn in still[:, 0]]
    stand = _mean(still, _mirror(still))
    stand = _mean(stand[:2], stand[2:])[0]
    left, right = cycle[:, 1], cycle[:, 2]
    swing = 2 * (_forward(right) - _forward(left))
    return {
        "swing": round(float(swing.max()), 3),
        "stand": np.round(stand, 4).tolist(),
        "cycle": np.round(cycle, 4).tolist(),
    }


def _forward(hips: Array) -> Array:
    """Half of a thigh's reach backwards, glTF."""
    return hips[:, 1] * hips[:, 2] + hips[:, 3] * hips[:, 0]


def _inverse(q: Array) -> Array:
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def _without_heading(turn: Array, all_turns: Array) -> Array:
    """Rotations relative to the mean heading of all about +Y."""
    x, y, z, w = all_turns.T
    yaw = np.arctan2((2 * (x * z + w * y)).mean(), (1 - 2 * (x * x + y * y)).mean())
    return multiply(np.array([0.0, -np.sin(yaw / 2), 0.0, np.cos(yaw / 2)]), turn)


def _mirror(poses: Array) -> Array:
    names = [bone.name for bone in load_skeleton()][:22]
    swapped = [
        names.index(
            name.replace("left", "right") if "left" in name else name.replace("right", "left")
        )
        for name in names
    ]
    return poses[:, swapped] * MIRRORED


def _mean(a: Array, b: Array) -> Array:
    b = np.where((a * b).sum(-1, keepdims=True) < 0, -b, b)
    mean = a + b
    return mean / np.linalg.norm(mean, axis=-1, keepdims=True)


def files() -> dict[Path, bytes]:
    """Path → content."""
    made = table()
    stand, cycle = (np.array(made[name]).ravel() for name in ("stand", "cycle"))
    about = "Written by `python -m tests.golden` from walk.json; see clients/README.md."
    return {
        CLIENTS / "python/wayfarer_client/gait.json": _json({"about": about, **made}),
        CLIENTS / "web/src/core/gait_table.js": (
            f"{MADE}\n/** Greatest swing of the stride. */\nexport const SWING = {made['swing']};\n"
            f"/** [bone][x, y, z, w] */\nexport const STAND = [\n{_rows(stand)}];\n"
            f"/** [pose][bone][x, y, z, w] */\nexport const CYCLE = [\n{_rows(cycle)}];\n"
        ).encode(),
        CLIENTS / "cpp/src/gait_table.hpp": (
            f"{MADE}#pragma once\n\nnamespace wayfarer::gait_table {{\n"
            f"inline constexpr float SWING = {made['swing']}f;\n"
            f"inline constexpr float STAND[22 * 4]{{\n{_rows(stand, 'f')}}};\n"
            f"inline constexpr float CYCLE[16 * 22 * 4]{{\n{_rows(cycle, 'f')}}};\n"
            "}  // namespace wayfarer::gait_table\n"
        ).encode(),
        CLIENTS / "unity/Runtime/Core/GaitTable.cs": (
            f"{MADE}namespace Wayfarer\n{{\n    internal static class GaitTable\n    {{\n"
            f"        internal const float Swing = {made['swing']}f;\n"
            f"        internal static readonly float[] Stand =\n        {{\n{_rows(stand, 'f')}"
            "        };\n"
            f"        internal static readonly float[] Cycle =\n        {{\n{_rows(cycle, 'f')}"
            "        };\n"
            "    }\n}\n"
        ).encode(),
        CLIENTS / "godot/addons/wayfarer/core/gait_table.gd": (
            f"class_name WayfarerGaitTable\nextends RefCounted\n{MADE.replace('//', '##')}\n"
            f"const SWING := {made['swing']}\n"
            f"const STAND: Array[float] = [\n{_rows(stand)}]\n"
            f"const CYCLE: Array[float] = [\n{_rows(cycle)}]\n"
        ).encode(),
    }


def _rows(numbers: Array, suffix: str = "") -> str:
    texts = [f"{number:.4f}{suffix}" for number in numbers]
    return "".join("  " + ", ".join(texts[k : k + 8]) + ",\n" for k in range(0, len(texts), 8))


def _json(value: dict[str, Any]) -> bytes:
    return (json.dumps(value) + "\n").encode()
