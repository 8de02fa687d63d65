"""Damaged and hostile mesh files for the readers of `navigation/meshes`."""

import json
import random
import re
import struct
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import DracoPy
import numpy as np
import trimesh

from tests.navigation.meshes.glb_files import glb
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.meshes.read import read_level
from wayfarer.navigation.scene_spec import MAX_TRIANGLES, MeshFile, MeshFormat, Walkable
from wayfarer.spec import MAX_COORDINATE

FORMATS: tuple[MeshFormat, ...] = ("glb", "obj", "ply")
MAX_BYTES = 200_000
"""Maximum size of a mutated file."""

NUMBERS = (
    *("0", "-0", "1", "-1", "2", "3", "-3", "7", "255", "256", "65535", "65536", "500000"),
    *("1500001", "2147483647", "2147483648", "-2147483648", "4294967295", "9007199254740993"),
    *("9223372036854775807", "-9223372036854775809", "18446744073709551616", "9" * 30, "9" * 5000),
    *("0.5", "1e9", "-1e9", "1e38", "1e308", "1e999", "-1e999", "1e-400", "nan", "inf", "-inf"),
    *("1_0", "0x10", "1,5", "½", "--1", "1/", "1//", "/1", "1/2/3", "true", "null", "[]", "{}"),
)
WORDS = (
    *("v", "f", "vn", "vt", "o", "mtllib ../../etc/passwd", "usemtl x", "\\\n", "#", "\t", "\r"),
    *("element vertex 4", "element face 1", "element edge 3", "element face 500000"),
    *("property list uchar int vertex_indices", "property list float int vertex_indices"),
    *("property list uint double vertex_index", "property float x", "property double z"),
    *("format ascii 1.0", "format binary_big_endian 1.0", "end_header\n", "obj_info x"),
    *("comment", "comment TextureFile /etc/passwd"),
)
VALUES = (
    *(0, 1, -1, 2, 3, 5, 10**6, 2**31, 2**63, 10**30, 0.5, 1e308, -1e308, True, False, None, ""),
    *([], [0], [[]], [0, 0], [1e308] * 16, [0] * 16, {}, {"a": 0}, "a", "file:///etc/passwd"),
    *(float("nan"), float("inf"), 5120, 5121, 5123, 5125, 5126, "VEC3", "SCALAR", "MAT4"),
)
"""Replacements for a value in glTF's JSON."""


def seeds(form: MeshFormat) -> list[bytes]:
    """Sound files, small, with what the format can hold."""
    box, ball = trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(subdivisions=1)
    painted = box.copy()
    painted.visual.face_colors = [200, 10, 10, 255]
    scene = trimesh.Scene([box, ball.apply_translation((3, 0, 0))])
    scene.add_geometry(box, transform=trimesh.transformations.scale_matrix(-2))
    if form == "glb":
        return [*(m.export(file_type="glb") for m in (box, ball, painted, scene)), packed(ball)]
    if form == "obj":
        hand = (
            b"mtllib a.mtl\no a\nv 0 0 0\nv 1 0 0 .1 .2 .3\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
            b"usemtl x\ns off\nf -4//1 -3//1 -2//1 -1//1\ng b\nf 1/1/1 2/1/1 \\\n3/1/1\nl 1 2\n"
        )
        return [hand, *(m.export(file_type="obj").encode() for m in (box, ball))]
    hand = (
        b"ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty "
        b"float y\nproperty float z\nproperty uchar red\nelement face 2\nproperty list uchar float "
        b"texcoord\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int a\n"
        b"end_header\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n2 .5 .5 3 0 1 2\n0 4 0 1 2 3\n7\n"
    )
    encodings = [(m, e) for m in (box, ball, painted) for e in ("ascii", "binary")]
    return [hand, *(m.export(file_type="ply", encoding=e) for m, e in encodings)]


def packed(mesh: trimesh.Trimesh) -> bytes:
    """A GLB whose one mesh is packed by Draco and stands there twice."""
    data = DracoPy.encode(mesh.vertices.astype("f4"), mesh.faces.astype("u4"))
    places = np.array([[0, 0, 0], [4, 0, 0]], "<f4").tobytes()
    blob = places + data + bytes(-len(data) % 4)
    extension = {"bufferView": 1, "attributes": {"POSITION": 0}}
    copies = {"attributes": {"TRANSLATION": 2}}
    document = {
        "asset": {"version": "2.0"},
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": copies}}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0},
                        "indices": 1,
                        "extensions": {"KHR_draco_mesh_compression": extension},
                    }
                ]
            }
        ],
        "accessors": [
            {"componentType": 5126, "count": len(mesh.vertices), "type": "VEC3"},
            {"componentType": 5125, "count": mesh.faces.size, "type": "SCALAR"},
            {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 24},
            {"buffer": 0, "byteOffset": 24, "byteLength": len(data)},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    return glb(document, blob)


@dataclass
class Mutator:
    """Draws damaged files; the same seed draws the same ones."""

    form: MeshFormat
    seed: int

    def __post_init__(self) -> None:
        self.chance = random.Random(f"{self.form} {self.seed}")
        self._seeds = seeds(self.form)

    def __iter__(self) -> Iterator[bytes]:
        """Yields files without end."""
        while True:
            data = self.chance.choice(self._seeds)
            for _ in range(self.chance.choice((1, 1, 2, 3, 8))):
                data = self.chance.choice(self._changes())(data)[:MAX_BYTES]
            yield self._closed(data)

    def _changes(self) -> list[Callable[[bytes], bytes]]:
        common = [self._bits, self._cut, self._repeat, self._spliced, self._filled, self._tail]
        if self.form == "glb":
            return [*common, *[self._document] * 6]
        return [*common, *[self._number] * 4, self._word, self._lines]

    def _place(self, data: bytes) -> slice:
        start = self.chance.randrange(len(data) + 1)
        return slice(start, start + self.chance.choice((0, 1, 2, 4, 16, 300)))

    def _bits(self, data: bytes) -> bytes:
        changed = bytearray(data)
        for _ in range(self.chance.randint(1, 8) if data else 0):
            changed[self.chance.randrange(len(data))] ^= 1 << self.chance.randrange(8)
        return bytes(changed)

    def _cut(self, data: bytes) -> bytes:
        at = self._place(data)
        return data[: at.start] + data[at.stop :]

    def _tail(self, data: bytes) -> bytes:
        return data[: self.chance.randrange(len(data) + 1)]

    def _repeat(self, data: bytes) -> bytes:
        at = self._place(data)
        return data[: at.stop] + data[at] * self.chance.choice((1, 2, 50)) + data[at.stop :]

    def _spliced(self, data: bytes) -> bytes:
        other = self.chance.choice(self._seeds)
        at = self._place(data)
        return data[: at.start] + other[self._place(other)] + data[at.stop :]

    def _filled(self, data: bytes) -> bytes:
        at = self._place(data)
        size = self.chance.choice((1, 2, 4, 8))
        filler = self.chance.choice((b"\xff" * size, b"\0" * size, b"\x7f" + b"\xff" * (size - 1)))
        return data[: at.start] + filler + data[at.start + size :]

    def _number(self, data: bytes) -> bytes:
        found = list(re.finditer(rb"[-+.\w]*\d[-+.\w]*", data[:20_000]))
        if not found:
            return data
        at = self.chance.choice(found)
        return data[: at.start()] + self.chance.choice(NUMBERS).encode() + data[at.end() :]

    def _word(self, data: bytes) -> bytes:
        at = data.find(b"\n", self._place(data).start) + 1
        return data[:at] + self.chance.choice(WORDS).encode() + b"\n" + data[at:]

    def _lines(self, data: bytes) -> bytes:
        lines = data.split(b"\n")
        one, other = (self.chance.randrange(len(lines)) for _ in range(2))
        lines[one], lines[other] = lines[other], lines[one]
        return b"\n".join(lines)

    def _document(self, data: bytes) -> bytes:
        """Another value somewhere in glTF's JSON."""
        try:
            length = struct.unpack_from("<I", data, 12)[0]
            document, rest = json.loads(data[20 : 20 + length]), data[20 + length :]
        except (struct.error, ValueError, RecursionError):
            return data
        self._poke(document)
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        return data[:12] + struct.pack("<II", len(text), 0x4E4F534A) + text + rest

    def _poke(self, node: object) -> None:
        while isinstance(node, dict | list) and node:
            key = self.chance.choice(list(node)) if isinstance(node, dict) else None
            at = key if key is not None else self.chance.randrange(len(node))
            below = node[at]  # type: ignore[index]
            if isinstance(below, dict | list) and below and self.chance.random() < 0.85:
                node = below
                continue
            if isinstance(node, dict) and self.chance.random() < 0.15:
                del node[key]
            elif isinstance(node, list) and self.chance.random() < 0.3:
                node.append(below)
            else:
                node[at] = self.chance.choice(VALUES)  # type: ignore[index]
            return

    def _closed(self, data: bytes) -> bytes:
        """Usually sets a GLB's true length, since otherwise no reader would read on."""
        if self.form == "glb" and len(data) >= 12 and self.chance.random() < 0.95:
            return data[:8] + struct.pack("<I", len(data)) + data[12:]
        return data


@dataclass
class Report:
    """Results for the files of one format."""

    form: MeshFormat
    files: int = 0
    read: int = 0
    refused: Counter[str] = field(default_factory=Counter)  # by the first words of the reason
    failures: list[tuple[str, bytes]] = field(default_factory=list)  # other failures, and the file
    slowest: float = 0.0  # seconds


def fuzz(form: MeshFormat, files: int, seed: int) -> Report:
    """Reads `files` damaged files."""
    report = Report(form)
    for data, _ in zip(Mutator(form, seed), range(files), strict=False):
        began = time.perf_counter()
        wrong = _wrong(MeshFile(data, form), report)
        report.slowest = max(report.slowest, time.perf_counter() - began)
        report.files += 1
        if wrong:
            report.failures.append((wrong, data))
    return report


def _wrong(mesh: MeshFile, report: Report) -> str:
    """The reader's fault with a file; empty if it has none."""
    try:
        corners = read_level(mesh, Walkable(), ())[0]
    except InvalidArgument as error:
        report.refused[re.sub(r"[\d,]+.*", "…", str(error))[:50]] += 1
        return "" if error.field == "mesh.data" else f"the field is {error.field!r}"
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        return f"{type(error).__name__}: {error}"[:300]
    report.read += 1
    if corners.shape[1:] != (3, 3) or not 0 < len(corners) <= MAX_TRIANGLES:
        return f"corners of shape {corners.shape}"
    return "" if (np.abs(corners) <= MAX_COORDINATE).all() else "corners that are too far away"
