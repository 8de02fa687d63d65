"""Poses → bytes. docs/wire-format.md shows every encoding byte by byte."""

from wayfarer.transport.codec.encoder import PoseEncoder
from wayfarer.transport.codec.packing import PackedPoses, encode
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat, PoseProfile

__all__ = [
    "PackedPoses",
    "PoseEncoder",
    "PoseEncoding",
    "PoseFormat",
    "PoseProfile",
    "encode",
]
