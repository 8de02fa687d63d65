"""Poses of far people, from reduced data: clients/README.md, "Far people"."""

import json
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from wayfarer_client.bases import Basis
from wayfarer_client.quaternions import Array, multiply

TABLE: Final = json.loads((Path(__file__).parent / "gait.json").read_text("utf-8"))
SWING: Final = float(TABLE["swing"])
BONES: Final = 22


class Roots(NamedTuple):
    """Frames of the encoding ROOT."""

    translation: Array  # [F, 3] hips
    heading: Array  # [F] radians
    phase: Array  # [F] turns
    swing: Array  # [F]


class Gait:
    """A stand and one stride, in a basis."""

    def __init__(self, basis: Basis) -> None:
        d = basis.handed
        turn = np.stack([d * basis.left, d * basis.up, d * basis.forward])  # rows: x, y, z of glTF
        self._up = basis.up
        self.stand = _turned(np.array(TABLE["stand"]), turn)
        self._cycle = _turned(np.array(TABLE["cycle"]), turn)

    def pose(self, heading: float, phase: float, swing: float) -> Array:
        """Rotations [22, 4] of someone who walks."""
        at = phase % 1 * len(self._cycle)
        k = int(at)
        before, after = self._cycle[k % len(self._cycle)], self._cycle[(k + 1) % len(self._cycle)]
        pose = _mixed(self.stand, _mixed(before, after, at - k), min(1.0, swing / SWING))
        half = heading / 2
        pose[0] = multiply(np.array([*np.sin(half) * self._up, np.cos(half)]), pose[0])
        return pose


def _turned(table: Array, turn: Array) -> Array:
    return np.concatenate([table[..., :3] @ turn, table[..., 3:]], axis=-1)


def _mixed(a: Array, b: Array, share: float) -> Array:
    """Interpolates rotations [22, 4] linearly along the shorter arc, normalised."""
    b = np.where((a * b).sum(-1, keepdims=True) < 0, -b, b)
    mixed = (1 - share) * a + share * b
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True))
