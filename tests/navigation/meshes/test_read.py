"""Readers against an independent writer (trimesh), and against hostile files."""

import struct
import tracemalloc
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.fuzz.meshes import fuzz
from tests.navigation.meshes.glb_files import glb
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.meshes.read import READERS, read_level
from wayfarer.navigation.scene_spec import Y_UP, Z_UP, MeshFile, MeshFormat, Walkable

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
    corners = read_level(MeshFile(written(mesh, form), form, axes=Z_UP), Walkable(), ())[0]
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


def test_indices_of_obj_count_back_from_where_they_stand() -> None:
    """Not from the file's end."""
    square = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n"
    corners = READERS["obj"](square + square.replace(b"1", b"5", 1).replace(b"-5", b"-1"))
    assert corners[0].max() == 1 and corners[1].max() == 5


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("last", [b"f 1 2 3", b"f 1 \\|2 3", b"f 1 2\\|3|", b"f 1 2 3\\"])
def test_lines_of_obj_end_in_any_way_and_may_go_on_below(end: bytes, last: bytes) -> None:
    data = end.join([b"v 0 0 0", b"v 1 0 0", b"v\t0 1 0", *last.split(b"|")])
    assert area(READERS["obj"](data)) == pytest.approx(0.5)


def test_faces_of_a_ply_may_have_different_numbers_of_corners() -> None:
    head = (
        "ply\nformat {} 1.0\nelement vertex 5\n"
        "property float x\nproperty float y\nproperty float z\nelement face 3\n"
        "property list uchar float texcoord\nproperty list uchar int vertex_indices\n"
        "property uchar red\nelement edge 1\nproperty int a\nend_header\n"
    )
    places = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (-1, 0.5, 0)]
    faces = [((), (0, 1, 2, 3)), ((0.5,), (0, 3, 4)), ((), (0, 2, 3))]
    lines = [" ".join(map(str, place)) for place in places]
    lines += [" ".join(map(str, (len(t), *t, len(f), *f, 9))) for t, f in faces]
    text = head.format("ascii") + "\n".join([*lines, "7"]) + "\n"
    assert area(READERS["ply"](text.encode())) == pytest.approx(2.0)
    for order, name in ("<", "binary_little_endian"), (">", "binary_big_endian"):
        body = b"".join(struct.pack(f"{order}3f", *place) for place in places)
        for t, f in faces:
            body += struct.pack(f"{order}B{len(t)}fB{len(f)}iB", len(t), *t, len(f), *f, 9)
        data = head.format(name).encode() + body + struct.pack(f"{order}i", 7)
        assert area(READERS["ply"](data)) == pytest.approx(2.0)


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
    flat = read_level(MeshFile(data, "obj", axes=Z_UP, unit=0.01), Walkable(), ())[0]
    np.testing.assert_allclose(flat[0], [[0, 0, 0], [1, 0, 0], [0, 1, 3]])
    turned = read_level(MeshFile(data, "obj", axes=Y_UP, unit=0.01), Walkable(), ())[0]
    np.testing.assert_allclose(turned @ GLTF_FROM_CORE.T, flat, atol=1e-12)


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
        "a file beside",
    ),
    "tessellated": (
        "glb",
        glb(triangle(extensionsRequired=["ACME_tessellation"]), BLOB),
        "ACME_tessellation",
    ),
    "a loop of nodes": (
        "glb",
        glb(triangle(nodes=[{"mesh": 0, "children": [0]}]), BLOB),
        "form a tree",
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
    "obj index beyond 64 bits": (
        "obj",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n",
        "line 4.*beyond",
    ),
    "obj negative index beyond 64 bits": (
        "obj",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -99999999999999999999\n",
        "line 4.*beyond",
    ),
    "obj number of 5,000 digits": ("obj", b"v 0 0 0\nf 1 1 " + b"9" * 5000, "line 2.*numbers"),
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
    "ply list length NaN": (
        "ply",
        b"ply\nformat ascii 1.0\nelement face 1\n"
        b"property list uchar int vertex_indices\nend_header\nnan 0 1 2\n",
        "length nan",
    ),
    "ply list length infinite": (
        "ply",
        b"ply\nformat ascii 1.0\nelement face 1\n"
        b"property list uchar int vertex_indices\nend_header\ninf 0 1 2\n",
        "length inf",
    ),
    "ply ends before its lists": (
        "ply",
        b"ply\nformat binary_little_endian 1.0\nelement face 400000\n"
        b"property list uchar int vertex_indices\nend_header\n\x00",
        "ends within element face",
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
        read_level(MeshFile(data, form), Walkable(), ())
    assert caught.value.field == "mesh.data"


@pytest.mark.parametrize("name", HOSTILE)
def test_claims_cost_no_memory(name: str) -> None:
    form, data, _ = HOSTILE[name]
    tracemalloc.start()
    try:
        with pytest.raises(InvalidArgument):
            read_level(MeshFile(data, form), Walkable(), ())
        assert tracemalloc.get_traced_memory()[1] < 100 * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("form", FORMATS)
def test_damaged_files_are_read_or_refused(form: MeshFormat) -> None:
    """A short run of benchmarks/fuzz_meshes.py."""
    report = fuzz(form, 1500, seed=7)
    assert report.files == 1500 and report.failures == []
    assert report.read > 50 and len(report.refused) > 3
