"""Poses on the wire: as a client reads them, and rotations in a basis."""

from typing import NamedTuple

import numpy as np

from wayfarer.transport.codec import PoseFormat
from wayfarer.transport.conversion.basis import Axes, Basis
from wayfarer.v1 import motion_pb2
from wayfarer_client.poses import PoseLayout


class DecodedPoses(NamedTuple):
    """Frames in the core basis: metres, Z up."""

    translation: np.ndarray  # [F, 3]
    rotations: np.ndarray  # [F, B, 4] of the bones of the format, unit length
    contacts: np.ndarray  # [F, 2] left, right


def decode(
    poses: bytes, contacts: bytes, basis: Basis, pose_format: PoseFormat = PoseFormat()
) -> DecodedPoses:
    """The inverse of the server's `encode` for one chunk, by the Python client."""
    layout = PoseLayout(motion_pb2.StreamHeader(**pose_format.header()))
    found, bits = layout.unpack(poses), np.frombuffer(contacts, np.uint8)
    assert len(found.translation) == len(bits)
    return DecodedPoses(
        basis.axes.points_to_core(found.translation),
        quaternions_to_core(basis.axes, found.rotations),
        (bits[:, None] & [1, 2]).astype(bool),
    )


def quaternions_to_wire(axes: Axes, quaternions: np.ndarray) -> np.ndarray:
    """Core quaternions x, y, z, w [..., 4] → the same rotations in the basis."""
    sources, signs = axes.quaternion_parts
    return quaternions[..., sources] * signs


def quaternions_to_core(axes: Axes, quaternions: np.ndarray) -> np.ndarray:
    """The inverse of `quaternions_to_wire`."""
    return quaternions @ axes.quaternion_matrix.astype(quaternions.dtype)
