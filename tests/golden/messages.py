"""Messages of a stream, as the official protobuf library encodes them."""

import json
import struct
from pathlib import Path

from wayfarer.v1 import agent_pb2, catalog_pb2, common_pb2, motion_pb2

FILE = Path(__file__).parent / "messages.json"
BONES = 2
NOW_US = 1_780_000_000_200_000


def float_poses(frames: int) -> bytes:
    """Frames that count up: hips k, k + 0.5, k + 0.25, then a quaternion per bone."""
    rows = [[k, k + 0.5, k + 0.25, 0.0, 0.0, 0.0, 1.0, 0.5, -0.5, 0.5, -0.5] for k in range(frames)]
    return b"".join(struct.pack("<11f", *row) for row in rows)


def small_poses(frames: int) -> bytes:
    """The hips as above, with smallest-three rotations whose x, y, z, w are all a half."""
    return b"".join(
        struct.pack("<3f3H", k, k + 0.5, k + 0.25, 27968, 27968, 27968) for k in range(frames)
    )


def header(**fields: object) -> motion_pb2.StreamHeader:
    bones = [
        catalog_pb2.Bone(name="pelvis", parent=-1, mixamo="Hips"),
        catalog_pb2.Bone(name="left_hip", parent=0, mixamo="LeftUpLeg"),
    ]
    return motion_pb2.StreamHeader(
        server_version="1.2.3",
        session_id="s-1",
        fps=40,
        basis=common_pb2.BasisInfo(basis=common_pb2.BASIS_GLTF, metres_per_unit=1.0),
        skeleton=catalog_pb2.Skeleton(bones=bones, posed_bones=BONES),
        resume_s=8.0,
        **fields,
    )


FULL = {
    "pose_encoding": motion_pb2.POSE_ENCODING_F32_LE,
    "sent_fps": 40,
    "bones": [0, 1],
    "frame_bytes": 44,
}
SMALL = {
    "pose_encoding": motion_pb2.POSE_ENCODING_SMALLEST_THREE,
    "bones": [1],
    "frame_bytes": 18,
}
ROOT = {"pose_encoding": motion_pb2.POSE_ENCODING_ROOT, "frame_bytes": 16}


def chunk(seq: int, poses: bytes, **fields: object) -> motion_pb2.MotionChunks:
    """One of agent 300, which walks."""
    usual: dict[str, object] = {
        "goal_revisions": [3],
        "states": [agent_pb2.AGENT_STATE_WALKING],
        "waypoints": [2],
    }
    return motion_pb2.MotionChunks(
        aliases=[300],
        seqs=[seq],
        first_frames=[8 * seq],
        scheduled_at_us=[1_779_999_997_723_456 + 200_000 * seq],
        poses=poses,
        **usual | fields,
    )


def messages() -> dict[str, motion_pb2.StreamMotionResponse]:
    """One of each kind, by name."""
    plain, small = header(**FULL), header(**SMALL, sent_fps=10, resumed=True)
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
    chunks = motion_pb2.MotionChunks(
        aliases=[300, 7],
        seqs=[12, 0],
        first_frames=[96, 0],
        scheduled_at_us=[1_780_000_000_123_456, 1_780_000_000_148_456],
        goal_revisions=[3, 0],
        states=[agent_pb2.AGENT_STATE_WALKING, agent_pb2.AGENT_STATE_STANDING],
        flags=[motion_pb2.CHUNK_FLAG_FIRST | motion_pb2.CHUNK_FLAG_ARRIVED, 0],
        poses=float_poses(6),
        contacts=bytes([1, 3, 2, 3, 3, 0]),
        waypoints=[2, 0],
        candidates=[8, 1],
    )
    held = chunk(
        13,
        small_poses(2),
        goal_revisions=[0],
        states=[agent_pb2.AGENT_STATE_STANDING],
        flags=[motion_pb2.CHUNK_FLAG_HELD | motion_pb2.CHUNK_FLAG_GAP],
        contacts=bytes([3, 3]),
        waypoints=[0],
        candidates=[0],
    )
    tiered = header(
        **FULL,
        tiers=[
            motion_pb2.Tier(radius=10, **FULL),
            motion_pb2.Tier(radius=30.5, **SMALL, sent_fps=20),
            motion_pb2.Tier(radius=300, **ROOT, sent_fps=10),
        ],
    )
    root = chunk(
        14,
        b"".join(struct.pack("<3fhBB", k, k + 0.5, k + 0.25, 16384, 64, 128) for k in (0, 1)),
        flags=[motion_pb2.CHUNK_FLAG_FIRST],
        contacts=bytes([1, 2]),
        candidates=[1],
    )
    # a former root: changes of tier have no flag
    closer = chunk(15, small_poses(4), flags=[0], contacts=bytes([1, 2, 1, 2]), candidates=[8])
    event = motion_pb2.Event(
        kind=motion_pb2.EVENT_KIND_GOAL_REACHED,
        agent_id="a-7",
        alias=300,
        at_us=1_780_000_000_123_456,
        goal_revision=3,
        waypoint=2,
        detail="goal 3 of 4 reached",
    )
    payloads = {
        "header": {"header": plain},
        "header_small": {"header": small},
        "batch": {
            "batch": motion_pb2.MotionBatch(
                added=[agent], chunks=chunks, removed=[1, 300], resume_token="r.1.41"
            )
        },
        "batch_small": {
            "batch": motion_pb2.MotionBatch(added=[agent], chunks=held, resume_token="r.1.42")
        },
        "header_tiers": {"header": tiered},
        "batch_root": {
            "batch": motion_pb2.MotionBatch(
                added=[agent], chunks=root, resume_token="r.1.43", tier=2, hidden=[7, 1000]
            )
        },
        "batch_closer": {
            "batch": motion_pb2.MotionBatch(chunks=closer, resume_token="r.1.44", tier=1)
        },
        "event": {"event": event},
        "heartbeat": {"heartbeat": motion_pb2.Heartbeat()},
    }
    return {
        name: motion_pb2.StreamMotionResponse(sent_at_us=NOW_US, **payload)
        for name, payload in payloads.items()
    }


def files() -> dict[Path, bytes]:
    """Content of messages.json."""
    encoded = {name: message.SerializeToString().hex() for name, message in messages().items()}
    return {FILE: (json.dumps(encoded, indent=1) + "\n").encode()}
