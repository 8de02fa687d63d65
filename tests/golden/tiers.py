"""Frames of tiers with fewer bones, and the poses that clients make from them."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden.vectors import congruential, draw
from tests.wire_poses import quaternions_to_core
from tests.world.fakes import motion_chunk
from wayfarer.body.skeleton import load_skeleton
from wayfarer.runtime.streams.root_tracks import RootTracks
from wayfarer.transport.codec import PoseEncoder, PoseEncoding, PoseFormat, PoseProfile
from wayfarer.transport.codec.root import ROOT_FRAME
from wayfarer.transport.conversion.basis import Basis
from wayfarer.v1 import common_pb2, motion_pb2
from wayfarer.world.agents.agent import MotionChunks
from wayfarer_client.poses import layouts_of

FILE = Path(__file__).parent / "tiers.json"
WALK = Path(__file__).parent / "walk.json"
CHOSEN = ("pelvis", "left_hip", "right_hip", "left_knee", "right_knee", "left_shoulder")
CHUNKS = 4
ENCODINGS = {
    encoding: motion_pb2.PoseEncoding.Value(f"POSE_ENCODING_{encoding.name}")
    for encoding in PoseEncoding
}


def doubled(rows: np.ndarray) -> np.ndarray:
    """Frames at 40 per second from frames at 20."""
    between = (rows + np.concatenate([rows[1:], rows[-1:]])) / 2
    return np.stack([rows, between], axis=1).reshape(-1, *rows.shape[1:]).astype(np.float32)


def chunks() -> list[MotionChunks]:
    """The beginning of the walk, at 40 frames a second, and turned a little more at each."""
    walk = json.loads(WALK.read_text())
    axes = Basis.GLTF.axes
    hips = axes.points_to_core(doubled(np.array(walk["hips"])))
    rotations = doubled(np.array(walk["rotations"]).reshape(-1, 22, 4))
    rotations = quaternions_to_core(axes, rotations)
    return [
        MotionChunks.of(
            [
                motion_chunk(
                    k,
                    agent_id="golden",
                    translation=hips[8 * k :][:8],
                    rotations=rotations[8 * k :][:8],
                )
            ]
        )
        for k in range(CHUNKS)
    ]


def tiers() -> list[PoseFormat]:
    """All of the body, some of it, roots."""
    return [
        PoseFormat(),
        PoseFormat.choose(PoseEncoding.SMALLEST_THREE, PoseProfile.BONES, CHOSEN, 20),
        PoseFormat.choose(PoseEncoding.ROOT),
    ]


def extremes() -> bytes:
    """Frames of ROOT with the minimum and maximum numbers."""
    numbers = congruential(9)
    frames = np.zeros(6, ROOT_FRAME)
    frames["translation"] = [draw(numbers)[:3] for _ in range(6)]
    frames["heading"] = [0, 32767, -32768, -1, 16384, -16384]
    frames["phase"] = [0, 255, 128, 64, 7, 200]
    frames["stride"] = [0, 255, 128, 64, 1, 100]
    return frames.tobytes()


def case(basis: Basis) -> dict[str, Any]:
    """Packed frames of the tiers, and the expected poses, in a basis."""
    header = motion_pb2.StreamHeader(
        fps=40,
        basis=common_pb2.BasisInfo(basis=f"BASIS_{basis.name}"),
        tiers=[motion_pb2.Tier(radius=10.0 * k, **f.header()) for k, f in enumerate(tiers(), 1)],
        **tiers()[0].header(),
    )
    _, layouts = layouts_of(header)
    tracks, encoder = RootTracks(), PoseEncoder()
    roots = np.concatenate([tracks.follow(made) for made in chunks()])
    found = []
    for tier, (pose_format, layout) in enumerate(zip(tiers(), layouts, strict=True)):
        if tier == 0:
            continue
        rows = np.array([0])
        packed = b"".join(
            encoder.encode(made, basis, pose_format, rows, roots[k : k + 1]).poses
            for k, made in enumerate(chunks())
        )
        if pose_format.encoding is PoseEncoding.ROOT:
            packed += extremes()
        poses = layout.unpack(packed)
        found.append(
            {
                "encoding": ENCODINGS[pose_format.encoding],
                "sent_fps": pose_format.fps,
                "bones": pose_format.bones,
                "frame_bytes": pose_format.frame_bytes,
                "poses": packed.hex(),
                "hips": np.round(poses.translation.astype(float), 6).ravel().tolist(),
                "rotations": np.round(poses.rotations.astype(float), 5).ravel().tolist(),
            }
        )
    return {"basis": basis.value, "bones": list(range(22)), "tiers": found}


def files() -> dict[Path, bytes]:
    """Content of tiers.json."""
    names = [bone.name for bone in load_skeleton()]
    cases = ",\n".join(json.dumps(case(basis)) for basis in Basis)
    text = f'{{"skeleton": {json.dumps(names[:22])}, "cases": [\n{cases}\n]}}\n'
    return {FILE: text.encode()}
