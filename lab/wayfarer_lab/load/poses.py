"""Checks that chunks hold valid poses, in a small sample, so that it costs next to nothing."""

import numpy as np

from wayfarer.v1 import motion_pb2

EVERY = 64
"""One chunk in this number is unpacked."""

TRANSLATION_FLOATS = 3
ROTATION_FLOATS = 4
NORM_TOLERANCE = 1e-3


class PoseCheck:
    """Checks chunks of one stream in float32, the default encoding."""

    def __init__(self, header: motion_pb2.StreamHeader | None = None) -> None:
        """`header` has the layout; without a header no chunk is valid."""
        bones = 0 if header is None else len(header.bones)
        self._frame_floats = TRANSLATION_FLOATS + ROTATION_FLOATS * bones if bones else 0
        self._seen = 0

    def passes(self, chunks: motion_pb2.MotionChunks, row: int) -> bool:
        """False if this chunk is in the sample and is not finite or has no unit quaternions."""
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
