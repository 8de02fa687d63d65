"""Messages put together by hand are what protobuf itself writes and reads."""

import pytest
from google.protobuf import wrappers_pb2
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.transport.streams.framing import field, varint
from wayfarer.v1 import control_pb2, motion_pb2


@given(st.integers(0, 2**64 - 1))
def test_varints_are_those_of_protobuf(value):
    tag, *rest = wrappers_pb2.UInt64Value(value=value).SerializeToString() or b"\x08\x00"
    assert tag == 1 << 3 and varint(value) == bytes(rest)


@pytest.mark.parametrize("size", [0, 1, 127, 128, 16_383, 16_384, 3_000_000])
def test_a_field_may_come_in_parts(size):
    poses = bytes(range(256)) * (size // 256 + 1)
    parts = [poses[: size // 3], memoryview(poses)[size // 3 : size]]
    number = motion_pb2.MotionChunks.POSES_FIELD_NUMBER
    found = motion_pb2.MotionChunks.FromString(b"".join(field(number, parts)))
    assert found == motion_pb2.MotionChunks(poses=poses[:size])


def test_messages_within_messages():
    event = motion_pb2.Event(detail="there")
    inner = field(motion_pb2.StreamMotionResponse.EVENT_FIELD_NUMBER, [event.SerializeToString()])
    time = motion_pb2.StreamMotionResponse(sent_at_us=5).SerializeToString()
    whole = b"".join(field(control_pb2.ControlResponse.MOTION_FIELD_NUMBER, [time, *inner]))
    motion = motion_pb2.StreamMotionResponse(sent_at_us=5, event=event)
    assert control_pb2.ControlResponse.FromString(whole) == control_pb2.ControlResponse(
        motion=motion
    )
