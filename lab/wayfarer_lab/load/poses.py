"""Whether poses are poses: seen in a sample of chunks, so that looking costs next to nothing."""

import numpy as np

from wayfarer.v1 import motion_pb2

EVERY = 64
"""One chunk of so many is unpacked."""

TRANSLATION_FLOATS = 3
ROTATION_FLOATS = 4
NORM_TOLERANCE = 1e-3


class PoseCheck:
    """Looks into chunks of one stream: float32, which streams have unless they ask for another."""

    def __init__(self, header: motion_pb2.StreamHeader | None = None) -> None:
        """`header` tells the layout; without one no chunk passes."""
        bones = 0 if header is None else len(header.bones)
        self._frame_floats = TRANSLATION_FLOATS + ROTATION_FLOATS * bones if bones else 0
        self._seen = 0

    def passes(self, chunks: motion_pb2.MotionChunks, row: int) -> bool:
        """False when this one is looked at and is no motion: finite numbers, unit quaternions."""
        self._seen += 1
        return self._seen % EVERY != 1 or self._is_motion(chunks, row)

    def _is_motion(self, chunks: motion_pb2.MotionChunks, row: int) -> bool:
        frames, size = len(chunks.contacts), 4 * self._frame_floats
        if not frames or frames % len(chunks.aliases) or len(chunks.poses) != size * frames:
            return False
        own = frames // len(chunks.aliases)
        values = np.frombuffer(chunks.poses, "<f4", own * self._frame_floats, row * own * size)
        values = values.reshape(own, self._frame_floats)
        rotations = values[:, TRANSLATION_FLOATS:].reshape(own, -1, ROTATION_FLOATS)
        off_unit = np.abs(np.linalg.norm(rotations, axis=-1) - 1)
        return bool(np.isfinite(values).all() and (off_unit < NORM_TOLERANCE).all())
