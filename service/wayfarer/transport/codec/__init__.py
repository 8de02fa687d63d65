"""Poses ↔ bytes. docs/wire-format.md shows every encoding byte by byte."""

from wayfarer.transport.codec.encoder import PoseEncoder
from wayfarer.transport.codec.packing import DecodedPoses, PackedPoses, decode, encode
from wayfarer.transport.codec.pose_format import PoseEncoding, PoseFormat, PoseProfile
from wayfarer.transport.codec.tier_encoder import TierEncoder

__all__ = [
    "DecodedPoses",
    "PackedPoses",
    "PoseEncoder",
    "PoseEncoding",
    "PoseFormat",
    "PoseProfile",
    "TierEncoder",
    "decode",
    "encode",
]
