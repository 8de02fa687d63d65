"""docs/wire-format.md agrees with the code."""

import re
import struct
from pathlib import Path

import numpy as np
import pytest

from tests.wire_poses import quaternions_to_wire
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoding, PoseFormat, PoseProfile, smallest_three
from wayfarer.transport.codec.root import ROOT_FRAME
from wayfarer.transport.conversion import convert
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.streams.websocket import PARAMETERS
from wayfarer.v1 import motion_pb2

PAGE = (Path(__file__).parents[2] / "docs" / "wire-format.md").read_text()


def rows(heading: str) -> list[list[str]]:
    """Cells of the table whose first row holds `heading`, without its first two rows."""
    lines = PAGE[PAGE.index(heading) :].splitlines()
    start = PAGE[: PAGE.index(heading)].splitlines()[-1] if heading[0] != "|" else ""
    table = [start + lines[0], *lines[1:]]
    end = next(k for k, line in enumerate(table) if not line.startswith("|"))
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table[2:end]]


def names(cell: str) -> list[str]:
    return re.findall(r"`([\w.]+)`", cell)


def test_every_field_of_header_and_chunk_is_described():
    for message, heading in (
        (motion_pb2.StreamHeader, "| field | meaning |\n|---|---|\n| `server_version`"),
        (motion_pb2.MotionChunks, "| field | meaning |\n|---|---|\n| `aliases`"),
    ):
        described = [name for first, *_ in rows(heading) for name in names(first)]
        assert sorted(described) == sorted(field.name for field in message.DESCRIPTOR.fields)


def test_flags_and_events_are_those_of_the_contract():
    flags = {name: int(number) for number, name, _ in rows("| flag |")}
    prefix = "CHUNK_FLAG_"
    assert {prefix + name: number for name, number in flags.items()} == {
        name: number for name, number in motion_pb2.ChunkFlag.items() if number
    }
    events = dict(row[0].split()[::-1] for row in rows("| kind | of |"))
    assert {f"EVENT_KIND_{name}": int(number) for name, number in events.items()} == {
        name: number for name, number in motion_pb2.EventKind.items() if number
    }


def test_the_query_of_the_socket_is_listed():
    listed = [names(row[1])[0] for row in rows("| `StreamMotionRequest` |")]
    assert sorted(listed) == sorted(PARAMETERS)


def test_sizes_and_errors_of_encodings():
    table = rows("| encoding | a rotation |")
    assert len(table) == len(PoseEncoding) - 1  # ROOT has a separate table
    for row in table:
        number, name = row[0].split()
        encoding = PoseEncoding[name.strip("`")]
        assert motion_pb2.PoseEncoding.Value(f"POSE_ENCODING_{encoding.name}") == int(number)
        sizes = [
            PoseFormat.choose(encoding, profile).frame_bytes
            for profile in (PoseProfile.BODY, PoseProfile.FULL)
        ]
        assert row[3] == f"{sizes[0]}, {sizes[1]}"
        assert int(row[2]) == encoding.rotation_type.itemsize
        if encoding is PoseEncoding.SMALLEST_THREE:
            assert row[4] == f"{np.ceil(1000 * smallest_three.WORST_ERROR_DEG) / 1000}°"


def test_the_layout_of_roots():
    assert "`ROOT` (4)" in PAGE and motion_pb2.POSE_ENCODING_ROOT == 4
    table = rows("| bytes of a frame | content |\n|---|---|\n| 0–11 |")
    assert [row[0] for row in table] == ["0–11", "12–13", "14", "15"]
    assert [ROOT_FRAME.fields[name][1] for name in ROOT_FRAME.names] == [0, 12, 14, 15]


def test_the_example_of_rings_is_accepted():
    text = PAGE.split("```json\n")[1].split("```")[0]
    rings = convert.rings(schema.Interest.model_validate_json(text), PoseFormat(), Basis.GLTF.axes)
    assert [ring.pose_format.frame_bytes for ring in rings] == [364, 12 + 5 * 6, 16]


def test_words_of_smallest_three():
    table = rows("| quaternion x, y, z, w |")
    assert table
    for quaternion, words in table:
        numbers = [float(text.replace("−", "-")) for text in quaternion.split(",")]
        packed = np.array(smallest_three.pack_one(*numbers), "<u2")
        assert packed.tobytes().hex(" ") == words.strip("`")


def test_the_example():
    lines = re.findall(r"^    ((?:[0-9a-f]{2} +)+)(.*)$", PAGE, re.MULTILINE)
    assert len(lines) == 2
    for text, numbers in lines:
        values = [float(number) for number in numbers.split()]
        assert bytes.fromhex(text) == struct.pack(f"<{len(values)}f", *values)


@pytest.mark.parametrize("basis", Basis)
def test_bases(basis):
    (row,) = (row for row in rows("| basis | handed |") if f"`{basis.name}`" in row[0])
    axes = basis.axes
    assert row[1] == ("right" if axes.handedness > 0 else "left")
    assert row[4] == ("m" if axes.metres_per_unit == 1 else "cm")
    for cell, vector in ((row[2], axes.up), (row[3], axes.forward)):
        sign, axis = cell.replace("−", "-")
        assert vector["XYZ".index(axis)] == (1 if sign == "+" else -1)
    core = {"x": 2.0, "y": 3.0, "z": 5.0, "w": 7.0}
    for cell, found in (
        (row[5], axes.points_to_wire(np.array([2.0, 3.0, 5.0]))),
        (row[6], quaternions_to_wire(axes, np.array([2.0, 3.0, 5.0, 7.0]))),
    ):
        scale = 100 if cell.startswith("100") else 1
        parts = re.findall(r"(−?)([xyzw])", cell)
        wanted = [scale * core[name] * (-1 if minus else 1) for minus, name in parts]
        np.testing.assert_allclose(found, wanted)
