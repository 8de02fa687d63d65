"""Readers against an independent writer (trimesh), and against hostile files."""

import json
import struct
import tracemalloc
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.meshes.read import READERS, read_mesh
from wayfarer.navigation.spec import Y_UP, Z_UP, MeshFile, MeshFormat

FORMATS: tuple[MeshFormat, ...] = ("glb", "obj", "ply")


def written(mesh: Any, form: str, **options: Any) -> bytes:
    data = mesh.export(file_type=form, **options)
    return data.encode() if isinstance(data, str) else data


def area(corners: np.ndarray) -> float:
    sides = corners[:, 1:] - corners[:, :1]
    return float(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1).sum() / 2)


@pytest.mark.parametrize("form", FORMATS)
def test_what_another_library_writes_is_read(form: MeshFormat) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=1.5)
    corners = read_mesh(MeshFile(written(mesh, form), form, axes=Z_UP))
    np.testing.assert_allclose(corners, mesh.triangles, atol=1e-6)


def test_ascii_ply_and_extra_columns_are_read() -> None:
    mesh = trimesh.creation.box((1, 2, 3))
    mesh.visual.face_colors = [200, 10, 10, 255]
    for encoding in ("ascii", "binary"):
        data = written(mesh, "ply", encoding=encoding)
        assert area(READERS["ply"](data)) == pytest.approx(mesh.area)


def test_polygons_and_negative_indices_of_obj_are_read() -> None:
    data = b"# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf -4//1 -3//1 -2//1 -1//1\n"
    assert area(READERS["obj"](data)) == pytest.approx(1.0)


def test_nodes_of_a_glb_place_and_share_meshes() -> None:
    scene = trimesh.Scene()
    box = trimesh.creation.box((1, 1, 1))
    scene.add_geometry(box, node_name="a", transform=trimesh.transformations.scale_matrix(2))
    scene.add_geometry(
        box,
        node_name="b",
        transform=trimesh.transformations.rotation_matrix(1, (1, 2, 3), (4, 5, 6)),
    )
    corners = READERS["glb"](scene.export(file_type="glb"))
    expected = np.concatenate([m.triangles for m in scene.dump()])
    assert area(corners) == pytest.approx(area(expected))
    np.testing.assert_allclose(corners.min((0, 1)), expected.min((0, 1)), atol=1e-5)
    np.testing.assert_allclose(corners.max((0, 1)), expected.max((0, 1)), atol=1e-5)


def test_up_axis_and_unit_are_applied() -> None:
    data = b"v 0 0 0\nv 100 0 0\nv 0 100 300\nf 1 2 3\n"
    flat = read_mesh(MeshFile(data, "obj", axes=Z_UP, unit=0.01))
    np.testing.assert_allclose(flat[0], [[0, 0, 0], [1, 0, 0], [0, 1, 3]])
    turned = read_mesh(MeshFile(data, "obj", axes=Y_UP, unit=0.01))
    np.testing.assert_allclose(turned @ GLTF_FROM_CORE.T, flat, atol=1e-12)


def glb(document: dict[str, Any], blob: bytes = b"") -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if blob:
        chunks += struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def triangle(**changes: Any) -> dict[str, Any]:
    """A document of one triangle, with parts of it replaced."""
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    }
    return {**document, **changes}


BLOB = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1]], "<f4").tobytes()
ACCESSOR = triangle()["accessors"][0]


def test_the_smallest_glb_is_read() -> None:
    assert area(READERS["glb"](glb(triangle(), BLOB))) == pytest.approx(0.5)


HOSTILE: dict[str, tuple[MeshFormat, bytes, str]] = {
    "empty": ("glb", b"", "shorter"),
    "not a glb": ("glb", b"PK\x03\x04" + bytes(64), "not a GLB"),
    "wrong length": ("glb", glb(triangle(), BLOB) + b"x", "the file has"),
    "no json": ("glb", struct.pack("<III", 0x46546C67, 2, 20) + bytes(8), "JSON"),
    "deep json": ("glb", glb({"a": 1}).replace(b'{"a": 1}', b"[" * 8), "JSON"),
    "count beyond the bytes": (
        "glb",
        glb(triangle(accessors=[{**ACCESSOR, "count": 1_000_000}]), BLOB),
        "claims",
    ),
    "count beyond reason": (
        "glb",
        glb(triangle(accessors=[{**ACCESSOR, "count": 10**15}]), BLOB),
        "allowed",
    ),
    "view beyond the file": (
        "glb",
        glb(triangle(bufferViews=[{"buffer": 0, "byteLength": 10**12, "byteOffset": 12}]), BLOB),
        "holds",
    ),
    "no data": (
        "glb",
        glb(triangle(accessors=[{"componentType": 5126, "count": 10**9, "type": "VEC3"}]), BLOB),
        "no data",
    ),
    "outside": (
        "glb",
        glb(triangle(buffers=[{"byteLength": 36, "uri": "file:///etc/passwd"}]), BLOB),
        "outside",
    ),
    "compressed": (
        "glb",
        glb(triangle(extensionsRequired=["KHR_draco_mesh_compression"]), BLOB),
        "draco",
    ),
    "a loop of nodes": (
        "glb",
        glb(triangle(nodes=[{"mesh": 0, "children": [0]}]), BLOB),
        "two parents",
    ),
    "a node with two parents": (
        "glb",
        glb(triangle(nodes=[{"children": [2]}, {"children": [2]}, {"mesh": 0}]), BLOB),
        "two parents",
    ),
    "many primitives of one accessor": (
        "glb",
        glb(
            triangle(
                meshes=[{"primitives": [{"attributes": {"POSITION": 0}}] * 100}],
                accessors=[{**ACCESSOR, "count": 90_000}],
                bufferViews=[{"buffer": 0, "byteLength": 90_000 * 12}],
            ),
            bytes(90_000 * 12),
        ),
        "triangles",
    ),
    "lists where numbers belong": ("glb", glb(triangle(nodes={"mesh": []}), BLOB), "malformed"),
    "negative mesh": ("glb", glb(triangle(nodes=[{"mesh": -1}]), BLOB), "no index"),
    "NaN": ("glb", glb(triangle(), np.full((3, 3), np.nan, "<f4").tobytes()), "not finite"),
    "no area": ("glb", glb(triangle(), bytes(36)), "no triangle with an area"),
    "obj without faces": ("obj", b"v 0 0 0\n", "no triangles"),
    "obj index": ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "beyond"),
    "obj index 0": ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "beyond"),
    "obj words": ("obj", b"v 0 0 zero\n", "line 1"),
    "obj short vertex": ("obj", b"\nv 0 0\n", "line 2"),
    "obj short face": ("obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n", "fewer than 3"),
    "obj infinite": ("obj", b"v 0 0 1e999\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
    "ply without header": ("ply", b"ply\nformat ascii 1.0\n", "end_header"),
    "ply claims": (
        "ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 999999999\nproperty float x\n"
        b"property float y\nproperty float z\nelement face 1\n"
        b"property list uchar int vertex_indices\nend_header\n",
        "allowed",
    ),
    "ply ends early": (
        "ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
        b"property float y\nproperty float z\nelement face 1\n"
        b"property list uchar int vertex_indices\nend_header\n" + bytes(20),
        "ends within",
    ),
    "ply list length": (
        "ply",
        b"ply\nformat binary_little_endian 1.0\nelement face 1\n"
        b"property list uint int vertex_indices\nend_header\n\xff\xff\xff\xff",
        "allowed",
    ),
    "ply words": (
        "ply",
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\nhello\n",
        "not all numbers",
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_end_in_a_clear_error(name: str) -> None:
    form, data, why = HOSTILE[name]
    with pytest.raises(InvalidArgument, match=why) as caught:
        read_mesh(MeshFile(data, form))
    assert caught.value.field == "mesh.data"


@pytest.mark.parametrize("name", HOSTILE)
def test_claims_cost_no_memory(name: str) -> None:
    form, data, _ = HOSTILE[name]
    tracemalloc.start()
    try:
        with pytest.raises(InvalidArgument):
            read_mesh(MeshFile(data, form))
        assert tracemalloc.get_traced_memory()[1] < 100 * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("form", FORMATS)
@settings(max_examples=60, deadline=None)
@given(cuts=st.data())
def test_damaged_files_are_read_or_refused(form: MeshFormat, cuts: st.DataObject) -> None:
    data = bytearray(written(trimesh.creation.box((1, 2, 3)), form))
    for _ in range(cuts.draw(st.integers(1, 6))):
        data[cuts.draw(st.integers(0, len(data) - 1))] = cuts.draw(st.integers(0, 255))
    try:
        corners = read_mesh(MeshFile(bytes(data[: cuts.draw(st.integers(0, len(data)))]), form))
    except InvalidArgument:
        pass
    else:
        assert np.isfinite(corners).all()
