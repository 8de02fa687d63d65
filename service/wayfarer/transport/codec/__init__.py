"""Poses ↔ bytes. docs/wire-format.md shows every encoding byte by byte."""

from wayfarer.transport.codec.encoder import PoseEncoder
from wayfarer.transport.codec.packing import DecodedPoses, PackedPoses, decode, encode
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat, PoseProfile

__all__ = [
    "DecodedPoses",
    "PackedPoses",
    "PoseEncoder",
    "PoseEncoding",
    "PoseFormat",
    "PoseProfile",
    "decode",
    "encode",
]
