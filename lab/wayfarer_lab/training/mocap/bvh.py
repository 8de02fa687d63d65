"""Reader for BVH motions.

Rotations multiply in the order of the channels of each joint. Position channels of the root are
added to its OFFSET. Those of another joint take the place of its OFFSET, as in Blender: most files
only restate it, others move the hips below a root that stands on the floor.
"""

import numpy as np

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.skeleton import (
    Array,
    MocapSkeleton,
    SkeletonMotion,
    euler_matrices,
)

RESTATED = 1e-3
"""File units by which the position channels of a joint may differ from its OFFSET, by rounding."""


class _Lines:
    """Non-empty lines as words, with their 1-based numbers."""

    def __init__(self, text: str, path: str) -> None:
        self._lines = text.splitlines()
        self._path = path
        self.number = 0

    def next(self, expected: str = "") -> list[str]:
        """Words of the next non-empty line, whose first word must be `expected` if given."""
        while self.number < len(self._lines):
            self.number += 1
            words = self._lines[self.number - 1].split()
            if words:
                if expected and words[0].upper() != expected.upper():
                    raise self.error(f"expected {expected}, got '{words[0]}'")
                return words
        raise self.error(f"the file ends, expected {expected or 'more lines'}")

    def error(self, message: str) -> DataError:
        return DataError(message, self._path, self.number)

    def numbers(self, words: list[str], count: int, what: str) -> Array:
        try:
            values = np.array([float(w) for w in words])
        except ValueError as error:
            raise self.error(f"{what}: {error}") from None
        if len(values) != count:
            raise self.error(f"{what} needs {count} numbers, got {len(values)}")
        if not np.isfinite(values).all():
            raise self.error(f"{what} holds a value that is not finite")
        return values


def read_bvh(text: str, path: str = "") -> SkeletonMotion:
    """Parses a BVH file. Raises DataError with the line that is wrong."""
    lines = _Lines(text, path)
    lines.next("HIERARCHY")
    names: list[str] = []
    parents: list[int] = []
    offsets: list[Array] = []
    channels: list[list[str]] = []
    ends: dict[str, Array] = {}
    stack: list[int] = []
    words = lines.next("ROOT")
    while True:
        key = words[0].upper()
        if key in ("ROOT", "JOINT"):
            name = " ".join(words[1:]) or f"joint{len(names)}"
            if name in names:
                raise lines.error(f"two joints are named '{name}'")
            names.append(name)
            parents.append(stack[-1] if stack else -1)
            stack.append(len(names) - 1)
            lines.next("{")
            offsets.append(lines.numbers(lines.next("OFFSET")[1:], 3, "OFFSET"))
            channels.append(_channels(lines, lines.next("CHANNELS")))
        elif key == "END":
            lines.next("{")
            ends[names[stack[-1]]] = lines.numbers(lines.next("OFFSET")[1:], 3, "OFFSET")
            lines.next("}")
        elif key == "}":
            if not stack:
                raise lines.error("a '}' too many")
            stack.pop()
            if not stack:
                break
        else:
            raise lines.error(f"expected JOINT, End Site or '}}', got '{words[0]}'")
        words = lines.next()
    lines.next("MOTION")
    words = lines.next("Frames:")
    frames = int(lines.numbers(words[1:], 1, "Frames:")[0])
    words = lines.next("Frame")
    step = float(lines.numbers(words[2:], 1, "Frame Time:")[0])
    if frames < 1 or step <= 0:
        raise lines.error(
            f"needs at least one frame and a positive frame time, got {frames}, {step}"
        )
    size = sum(len(c) for c in channels)
    table = np.empty((frames, size))
    for i in range(frames):
        table[i] = lines.numbers(lines.next(), size, f"frame {i}")
    skeleton = MocapSkeleton(tuple(names), tuple(parents), np.array(offsets), ends)
    return _motion(skeleton, channels, table, 1.0 / step)


def _channels(lines: _Lines, words: list[str]) -> list[str]:
    known = [f"{a}{kind}" for kind in ("position", "rotation") for a in "XYZ"]
    found = [w[0].upper() + w[1:].lower() for w in words[2:]]
    if len(words) < 2 or words[1] != str(len(found)) or not set(found) <= set(known):
        raise lines.error(f"CHANNELS needs a count and names out of {known}, got {words[1:]}")
    return found


def _motion(
    skeleton: MocapSkeleton, channels: list[list[str]], table: Array, fps: float
) -> SkeletonMotion:
    frames = len(table)
    root = np.zeros((frames, 3)) + skeleton.offsets[0]
    local = np.empty((frames, len(skeleton.names), 3, 3))
    column, shifts = 0, {}
    for j, names in enumerate(channels):
        values = table[:, column : column + len(names)]
        column += len(names)
        turns = [k for k, n in enumerate(names) if n.endswith("rotation")]
        local[:, j] = euler_matrices(values[:, turns], "".join(names[k][0] for k in turns))
        moved = np.zeros((frames, 3)) + skeleton.offsets[j]
        for k, n in enumerate(names):
            if n.endswith("position"):
                axis = "XYZ".index(n[0])
                if j == 0:
                    root[:, axis] += values[:, k]
                else:
                    moved[:, axis] = values[:, k]
        if not np.allclose(moved, skeleton.offsets[j], atol=RESTATED):
            shifts[j] = moved
    return SkeletonMotion(skeleton, root, local, fps, shifts)
