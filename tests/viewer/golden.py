"""Messages as the official protobuf library encodes them, for the viewer's own decoder.

`PYTHONPATH=service python -m tests.viewer.golden` writes `golden.json`; test_golden.py fails when
the file is no longer what the contract gives.
"""

import json
import struct
from pathlib import Path

from wayfarer.v1 import agent_pb2, catalog_pb2, common_pb2, motion_pb2

FILE = Path(__file__).parent / "golden.json"
BONES = 2


def poses(frames: int) -> bytes:
    """Frames that count up: hips k, k + 0.5, k + 0.25, then a quaternion per bone."""
    rows = [[k, k + 0.5, k + 0.25, 0.0, 0.0, 0.0, 1.0, 0.5, -0.5, 0.5, -0.5] for k in range(frames)]
    return b"".join(struct.pack("<11f", *row) for row in rows)


def messages() -> dict[str, motion_pb2.StreamMotionResponse]:
    """One of each kind, by name."""
    bones = [
        catalog_pb2.Bone(name="pelvis", parent=-1, mixamo="Hips"),
        catalog_pb2.Bone(name="left_hip", parent=0, mixamo="LeftUpLeg"),
    ]
    header = motion_pb2.StreamHeader(
        server_version="1.2.3",
        session_id="s-1",
        fps=40,
        basis=common_pb2.BasisInfo(basis=common_pb2.BASIS_GLTF, metres_per_unit=1.0),
        skeleton=catalog_pb2.Skeleton(bones=bones, posed_bones=BONES),
        pose_encoding=motion_pb2.POSE_ENCODING_F32_LE,
    )
    agent = agent_pb2.Agent(
        agent_id="a-7",
        alias=300,
        session_id="s-1",
        name="Zoë",
        body="anny52",
        gender=agent_pb2.GENDER_MALE,
        betas=[0.5, -1.25, 3.0],
        seed=2**32 - 1,
        heading=-0.5,
        created_at_us=1_780_000_000_000_000,
        rest_offsets=[0.0, 1.0, 2.0],
    )
    chunk = motion_pb2.MotionChunk(
        alias=300,
        seq=12,
        first_frame=96,
        scheduled_at_us=1_780_000_000_123_456,
        goal_revision=3,
        state=agent_pb2.AGENT_STATE_WALKING,
        flags=motion_pb2.CHUNK_FLAG_FIRST | motion_pb2.CHUNK_FLAG_ARRIVED,
        poses=poses(3),
        contacts=bytes([1, 3, 2]),
        waypoint=2,
        candidates=8,
    )
    batch = motion_pb2.MotionBatch(added=[agent], chunks=[chunk], removed=[1, 300])
    now = 1_780_000_000_200_000
    return {
        "header": motion_pb2.StreamMotionResponse(sent_at_us=now, header=header),
        "batch": motion_pb2.StreamMotionResponse(sent_at_us=now, batch=batch),
        "heartbeat": motion_pb2.StreamMotionResponse(
            sent_at_us=now, heartbeat=motion_pb2.Heartbeat()
        ),
    }


def text() -> str:
    """The file's content."""
    encoded = {name: message.SerializeToString().hex() for name, message in messages().items()}
    return json.dumps(encoded, indent=1) + "\n"


if __name__ == "__main__":
    FILE.write_text(text())
