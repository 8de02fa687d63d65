"""The motion of the golden vectors, and its packings."""

import json
import math
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from tests.wire_poses import quaternions_to_wire
from tests.world.fakes import motion_chunk
from wayfarer.body.skeleton import load_skeleton
from wayfarer.transport import codec
from wayfarer.transport.codec import PoseEncoding, PoseFormat, PoseProfile
from wayfarer.transport.conversion.basis import Basis
from wayfarer.world.agents.agent import MotionChunk, MotionChunks

FOLDER = Path(__file__).parent
FILE = FOLDER / "vectors.json"
FRAMES = 5
FIRST_FRAME = 8  # at 20 fps its frames 8, 10, 12 are sent; at 10 fps 8 and 12
CHOSEN = ["pelvis", "left_wrist", "head", "left_index1"]
SPECIAL = [  # rotations in which encodings could go wrong
    (0.0, 0.0, 0.0, 1.0),
    (0.0, 0.0, 0.0, -1.0),
    (0.5, 0.5, 0.5, 0.5),
    (-0.5, 0.5, -0.5, 0.5),
    (1.0, 0.0, 0.0, 0.0),
    (0.0, -1.0, 0.0, 0.0),
    (0.0, 0.6, -0.8, 0.0),
    (0.6, -0.8, 0.0, 0.0),
]
TOLERANCE_DEG = {"f32_le": 0.0, "smallest_three": 0.009}
ENCODINGS = [PoseEncoding(name) for name in TOLERANCE_DEG]  # of poses


@dataclass(frozen=True)
class Vector:
    """One packing of the motion."""

    basis: Basis
    encoding: PoseEncoding
    profile: PoseProfile
    fps: int

    @property
    def name(self) -> str:
        return f"{self.basis}-{self.encoding}-{self.profile}-{self.fps}"

    @property
    def file(self) -> Path:
        return FOLDER / "poses" / f"{self.name}.bin"

    @property
    def pose_format(self) -> PoseFormat:
        names = CHOSEN if self.profile is PoseProfile.BONES else ()
        return PoseFormat.choose(self.encoding, self.profile, names, self.fps)

    def pack(self, motion: MotionChunk) -> codec.PackedPoses:
        return codec.encode(MotionChunks.of([motion]), self.basis, self.pose_format)

    def describe(self, packed: codec.PackedPoses) -> dict[str, Any]:
        count = len(packed.contacts)
        return {
            "name": self.name,
            "poses": f"poses/{self.file.name}",
            "basis": self.basis,
            "encoding": self.encoding,
            "profile": self.profile,
            "sent_fps": self.fps,
            "bones": self.pose_format.bones,
            "frame_bytes": self.pose_format.frame_bytes,
            "first_frame": FIRST_FRAME,
            "frames": [k * self.pose_format.stride for k in range(count)],
            "contacts": packed.contacts.hex(),
        }


def vectors() -> list[Vector]:
    """Every encoding × profile × basis at 40 fps; every encoding at the lower rates."""
    full_rate = product(Basis, ENCODINGS, PoseProfile, [40])
    lower = product([Basis.GLTF], ENCODINGS, [PoseProfile.BODY], [20, 10])
    return [Vector(*row) for row in (*full_rate, *lower)]


def draw(numbers: Any) -> tuple[float, ...]:
    """Four numbers of length 1, by operations that are exact everywhere."""
    x, y, z, w = (next(numbers) for _ in range(4))
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return x / length, y / length, z / length, w / length


def congruential(state: int) -> Any:
    """Numbers in [-1, 1)."""
    while True:
        state = (1103515245 * state + 12345) % 2**31
        yield state / 2**30 - 1


def core_motion() -> dict[str, Any]:
    """Translation [F][3], rotations [F][22][4] (float32 values), contacts [F][2]."""
    numbers = congruential(4)
    translation = [[7 * next(numbers) for _ in range(3)] for _ in range(FRAMES)]
    rotations = [[draw(numbers) for _ in range(22)] for _ in range(FRAMES)]
    rotations[0][1 : 1 + len(SPECIAL)] = SPECIAL
    return {
        "translation": np.array(translation, np.float32).tolist(),
        "rotations": np.array(rotations, np.float32).tolist(),
        "contacts": [[0, 0], [1, 0], [0, 1], [1, 1], [1, 0]],
    }


def motion_of(core: dict[str, Any]) -> MotionChunk:
    """The runtime's chunk of a `core_motion`."""
    return motion_chunk(
        agent_id="golden",
        first_frame=FIRST_FRAME,
        translation=np.array(core["translation"], np.float32),
        rotations=np.array(core["rotations"], np.float32),
        contacts=np.array(core["contacts"], bool),
    )


def in_basis(core: dict[str, Any], basis: Basis) -> dict[str, Any]:
    """The same poses in a basis, as the float32 numbers that F32_LE holds."""
    translation = np.array(core["translation"], np.float32)
    rotations = np.array(core["rotations"], np.float32)
    return {
        "translation": basis.axes.points_to_wire(translation).tolist(),
        "rotations": quaternions_to_wire(basis.axes, rotations).tolist(),
    }


def files() -> dict[Path, bytes]:
    """Content of vectors.json and of all poses."""
    core = core_motion()
    motion = motion_of(core)
    packed = {vector: vector.pack(motion) for vector in vectors()}
    document = {
        "about": "See README.md. Numbers are float32; quaternions are x, y, z, w.",
        "skeleton": [bone.name for bone in load_skeleton()],
        "tolerance_deg": TOLERANCE_DEG,
        "core": core,
        "bases": {basis.value: in_basis(core, basis) for basis in Basis},
        "vectors": [vector.describe(poses) for vector, poses in packed.items()],
    }
    return {
        FILE: _text(document).encode(),
        **{vector.file: poses.poses for vector, poses in packed.items()},
    }


def _text(document: dict[str, Any]) -> str:
    """JSON with one entry of a list per line at the top levels, so that a change can be read."""
    rows = []
    for key, value in document.items():
        if key == "vectors":
            lines = ",\n".join(f"  {json.dumps(entry)}" for entry in value)
            rows.append(f' "{key}": [\n{lines}\n ]')
        elif key == "bases":
            lines = ",\n".join(f'  "{name}": {json.dumps(entry)}' for name, entry in value.items())
            rows.append(f' "{key}": {{\n{lines}\n }}')
        else:
            rows.append(f' "{key}": {json.dumps(value)}')
    return "{\n" + ",\n".join(rows) + "\n}\n"
