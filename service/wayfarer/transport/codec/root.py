"""Roots ↔ bytes: 16 bytes per frame, in every basis. See docs/wire-format.md, "ROOT"."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.transport.conversion.basis import Basis

ROOT_FRAME: Final = np.dtype(
    [("translation", "<f4", (3,)), ("heading", "<i2"), ("phase", "u1"), ("stride", "u1")]
)


def pack_roots(roots: NDArray[np.float32], basis: Basis) -> NDArray[Any]:
    """Packs roots [A, R, 6] of root_tracks.py as frames [A, R]."""
    packed = np.empty(roots.shape[:2], ROOT_FRAME)
    axes = basis.axes
    axes.points_to_wire(roots[..., :3], out=packed["translation"])
    turns = axes.handedness * roots[..., 3].astype(float) / np.pi
    packed["heading"] = np.rint(turns * 32768).astype(np.int64).astype(np.uint16).view(np.int16)
    packed["phase"] = np.rint(roots[..., 4] * 256).astype(np.int64) & 0xFF
    packed["stride"] = np.rint(roots[..., 5] * 128).clip(0, 255)
    return packed
