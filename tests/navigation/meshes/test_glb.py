"""Contents of exported GLBs: extensions, copies, packed data, skins, buffers of any kind."""

import base64
from typing import Any

import DracoPy
import meshopt
import numpy as np
import pytest

from tests.navigation.meshes.glb_files import LEVELS, Packer, glb, grid
from wayfarer.errors import InvalidArgument
from wayfarer.navigation.meshes.glb import read_glb
from wayfarer.navigation.meshes.read import read_level
from wayfarer.navigation.scene_spec import MeshFile, Walkable

TRIANGLE = np.array([[0, 0, 0], [2, 0, 0], [0, 0, 1]], np.float32)
LOOKS = (
    *("KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"),
    *("KHR_texture_transform", "KHR_materials_unlit", "KHR_materials_clearcoat"),
    *("KHR_materials_pbrSpecularGlossiness", "KHR_materials_variants", "ADOBE_materials_thin"),
    *("KHR_lights_punctual", "EXT_lights_image_based", "EXT_lights_ies", "KHR_animation_pointer"),
    *("KHR_xmp_json_ld", "EXT_structural_metadata", "KHR_node_visibility", "MSFT_lod"),
)


def of(packer: Packer, **document: Any) -> np.ndarray:
    return read_glb(packer.file(**document))


def plain() -> Packer:
    packer = Packer()
    packer.accessor(TRIANGLE)
    return packer


@pytest.mark.parametrize("name", LOOKS)
def test_what_a_level_looks_like_never_refuses_it(name: str) -> None:
    found = of(plain(), extensionsRequired=[name], extensionsUsed=[name])
    np.testing.assert_array_equal(found, TRIANGLE[None])


@pytest.mark.parametrize("name", ["ACME_tessellation", "KHR_gaussian_splatting"])
def test_what_changes_triangles_and_is_not_read_is_refused_by_name(name: str) -> None:
    with pytest.raises(InvalidArgument, match=f"{name}, which is not read: export without it"):
        of(plain(), extensionsRequired=["KHR_materials_unlit", name])


def hill(side: int = 12) -> tuple[np.ndarray, np.ndarray]:
    vertices, faces = grid(side)
    vertices[:, 1] = 0.3 * np.sin(vertices[:, 0])
    return vertices, faces


@pytest.mark.parametrize(
    "tool", ["gltfpack_cc", "gltfpack_cz", "gltfpack_c_noq", "gltfpack_c_vpf", "draco"]
)
def test_what_tools_have_packed_is_unpacked(tool: str) -> None:
    """`gltfpack -i hill.glb -o ….glb -si 1` with -cc, -cz (KHR_meshopt_compression), -c -noq and
    -c -vpf (a filter), of gltfpack 1.3 from npm; and gltf-transform's `draco`.
    """
    found = read_glb((LEVELS / f"hill_{tool}.glb").read_bytes())
    vertices, faces = hill()
    for one, other in ((found, vertices[faces]), (found.mean(1), vertices[faces].mean(1))):
        one, other = (np.sort(a.reshape(-1, 3), axis=0) for a in (one, other))
        np.testing.assert_allclose(one, other, atol=5e-4)


def packed_by_meshopt(order_as: str = "TRIANGLES", **changes: Any) -> bytes:
    """`changes`: of the extension of the vertices' buffer view."""
    vertices, faces = hill(4)
    packer = Packer()
    order = faces.reshape(-1).astype(np.uint32)
    for values, how in ((vertices, "ATTRIBUTES"), (order, order_as)):
        data = meshopt.encode_gltf_buffer(values, how)
        stride = values.dtype.itemsize * (3 if how == "ATTRIBUTES" else 1)
        view = packer.views[packer.view(data)]
        extension = {**view, "count": len(values), "byteStride": stride, "mode": how}
        view |= {"buffer": 1, "byteOffset": 0, "byteLength": stride * len(values)}
        view["extensions"] = {"EXT_meshopt_compression": extension | changes}
        packer.describe(values, bufferView=len(packer.views) - 1)
        changes = {}
    return packer.file(
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        buffers=[{"byteLength": len(packer.blob)}, {"byteLength": 9}],
        extensionsRequired=["EXT_meshopt_compression"],
    )


@pytest.mark.parametrize("mode", ["TRIANGLES", "INDICES"])
def test_what_meshopt_has_packed_is_unpacked(mode: str) -> None:
    vertices, faces = hill(4)
    found = np.sort(read_glb(packed_by_meshopt(mode)).mean(1), axis=0)
    np.testing.assert_allclose(found, np.sort(vertices[faces].mean(1), axis=0), atol=1e-6)


def test_the_limits_hold_before_meshopt_unpacks() -> None:
    """A claim of 140 MB in a file of a few hundred bytes costs nothing."""
    with pytest.raises(InvalidArgument, match=r"has 140,000,000 bytes, unpacked; .* 134,217,728"):
        read_glb(packed_by_meshopt(count=14_000_000, byteStride=10))


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"byteLength": 9}, "cannot be unpacked"),
        ({"byteLength": 10**6}, "beyond its buffer's end"),
        ({"count": 3}, "cannot be unpacked"),
        ({"byteStride": 7}, "cannot be unpacked"),
        ({"mode": "POINTS"}, "cannot be unpacked"),
        ({"filter": "SMOOTH"}, "cannot be unpacked"),
        ({"count": 0, "byteLength": 0}, "cannot be unpacked|holds 0"),
    ],
)
def test_damaged_meshopt_is_refused(changes: dict[str, Any], why: str) -> None:
    with pytest.raises(InvalidArgument, match=why):
        read_glb(packed_by_meshopt(**changes))


def test_meshopt_beside_plain_data_is_passed_over() -> None:
    packer = plain()
    packer.views[0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 1}}
    found = of(packer, extensionsUsed=["EXT_meshopt_compression"])
    np.testing.assert_array_equal(found, TRIANGLE[None])


@pytest.mark.parametrize("kind", ["int8", "uint8", "int16", "uint16"])
@pytest.mark.parametrize("normalized", [False, True])
def test_quantized_positions_are_what_they_stand_for(kind: str, normalized: bool) -> None:
    most = np.iinfo(kind).max
    packer = Packer()
    stored = (TRIANGLE / 2 * most).round().astype(kind)
    packer.accessor(stored, normalized=normalized)
    scale = [2.0, 2.0, 2.0] if normalized else [2 / most] * 3
    node = {"mesh": 0, "scale": scale, "translation": [5, 0, 0]}
    found = of(packer, nodes=[node], extensionsRequired=["KHR_mesh_quantization"])
    np.testing.assert_allclose(found[0], TRIANGLE + np.array([5, 0, 0]), atol=2.1 / most)


def packed_by_draco(side: int, **changes: Any) -> bytes:
    vertices, faces = grid(side)
    packer = Packer()
    data = DracoPy.encode(vertices, faces, quantization_bits=14)
    view = packer.view(data)
    position = packer.describe(vertices)
    order = packer.describe(faces.reshape(-1))
    extension = {"bufferView": view, "attributes": {"POSITION": 0}, **changes}
    primitive = {
        "attributes": {"POSITION": position},
        "indices": order,
        "extensions": {"KHR_draco_mesh_compression": extension},
    }
    return packer.file(
        meshes=[{"primitives": [primitive]}],
        extensionsRequired=["KHR_draco_mesh_compression"],
    )


def test_what_draco_has_packed_is_unpacked() -> None:
    found = read_glb(packed_by_draco(12))
    sides = found[:, 1:] - found[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1).sum() / 2
    assert len(found) == 288 and area == pytest.approx(144, abs=0.1)
    np.testing.assert_allclose(found.max((0, 1)), [12, 0, 12], atol=0.01)


def test_the_limits_hold_for_what_draco_unpacks() -> None:
    """600,000 triangles in some 100 KB."""
    data = packed_by_draco(548)
    assert len(data) < 1_000_000
    with pytest.raises(InvalidArgument, match=r"600,608 triangles of a mesh, unpacked"):
        read_glb(data)


@pytest.mark.parametrize("changes", [{"attributes": {}}, {"attributes": {"POSITION": 7}}])
def test_draco_without_positions_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(InvalidArgument, match="a primitive has no positions"):
        read_glb(packed_by_draco(4, **changes))


def test_damaged_draco_is_refused() -> None:
    data = packed_by_draco(4)
    at = data.index(b"DRACO")
    for broken in (
        data[:at] + b"DRAGO" + data[at + 5 :],
        data[: at + 12] + bytes(8) + data[at + 20 :],
    ):
        with pytest.raises(InvalidArgument, match="cannot be unpacked"):
            read_glb(broken)


def test_draco_beside_plain_data_is_passed_over() -> None:
    packer = plain()
    extension = {"KHR_draco_mesh_compression": {"bufferView": 9, "attributes": {"POSITION": 0}}}
    meshes = [{"primitives": [{"attributes": {"POSITION": 0}, "extensions": extension}]}]
    np.testing.assert_array_equal(of(packer, meshes=meshes), TRIANGLE[None])


def instanced(packer: Packer, node: dict[str, Any] | None = None, **attributes: int) -> np.ndarray:
    extension = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    return of(packer, nodes=[{"mesh": 0, **(node or {}), "extensions": extension}])


def test_copies_of_a_mesh_count_with_their_places_turns_and_sizes() -> None:
    packer = plain()
    moves = packer.accessor(np.array([[0, 0, 0], [10, 0, 0]], np.float32))
    # about up by a right angle: x becomes -z; as normalized shorts
    turns = packer.accessor(
        np.array([[0, 0, 0, 32767], [0, 23170, 0, 23170]], np.int16), normalized=True
    )
    sizes = packer.accessor(np.array([[1, 1, 1], [3, 1, 1]], np.float32))
    found = instanced(packer, TRANSLATION=moves, ROTATION=turns, SCALE=sizes)
    np.testing.assert_allclose(found[0], TRIANGLE)
    np.testing.assert_allclose(found[1], [[10, 0, 0], [10, 0, -6], [11, 0, 0]], atol=1e-3)


def test_copies_stand_in_the_nodes_own_axes_and_a_mirror_turns_them_over() -> None:
    packer = plain()
    moves = packer.accessor(np.array([[0, 0, 0], [1, 0, 0]], np.float32))
    found = instanced(packer, {"scale": [-2, 1, 1]}, TRANSLATION=moves)
    np.testing.assert_allclose(found[1], (TRIANGLE * [-2, 1, 1] - [2, 0, 0])[::-1])


def test_seven_walls_of_one_mesh_are_seven_walls() -> None:
    corners = read_glb((LEVELS / "instanced_walls.glb").read_bytes())
    middles = {tuple(np.round(c, 1)) for c in corners.mean(1).tolist()}
    assert len(corners) > 70 and len(middles) > 60


def test_copies_that_contradict_each_other_or_are_too_many_are_refused() -> None:
    packer = plain()
    two = packer.accessor(np.zeros((2, 3), np.float32))
    three = packer.accessor(np.ones((3, 3), np.float32))
    with pytest.raises(InvalidArgument, match=r"elements, and not one number"):
        instanced(packer, TRANSLATION=two, SCALE=three)
    vertices, faces = grid(30)
    packer = Packer()
    packer.accessor(vertices)
    order = packer.accessor(faces.reshape(-1))
    many = packer.accessor(np.zeros((300, 3), np.float32))
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": many}}}
    primitive = {"attributes": {"POSITION": 0}, "indices": order}
    with pytest.raises(InvalidArgument, match="540,000 triangles"):
        of(
            packer,
            meshes=[{"primitives": [primitive]}],
            nodes=[{"mesh": 0, "extensions": extension}],
        )


def uri(data: bytes, head: str = "data:application/octet-stream;base64,") -> dict[str, Any]:
    return {"byteLength": len(data), "uri": head + base64.b64encode(data).decode()}


@pytest.mark.parametrize("head", ["data:application/octet-stream;base64,", "data:;base64,"])
def test_buffers_as_data_uris_are_inside_the_file(head: str) -> None:
    packer = plain()
    document = {"bufferViews": packer.views, "accessors": packer.accessors}
    made = Packer().file(**document, buffers=[uri(packer.blob, head)])
    np.testing.assert_array_equal(read_glb(made), TRIANGLE[None])


def test_a_data_uri_beside_the_binary_chunk_is_read() -> None:
    packer = plain()
    order = np.array([0, 2, 1], np.uint16).tobytes()
    packer.views.append({"buffer": 1, "byteLength": 6})
    packer.accessors.append({"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"})
    found = of(
        packer,
        buffers=[{"byteLength": len(packer.blob)}, uri(order)],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    )
    np.testing.assert_array_equal(found, TRIANGLE[None, [0, 2, 1]])


@pytest.mark.parametrize(
    ("buffer", "why"),
    [
        ({"uri": "level.bin"}, "'level.bin', a file beside this one"),
        ({"uri": "https://a.example/b.bin"}, "a file beside this one"),
        ({"uri": "data:application/octet-stream,abc"}, "not in base64"),
        ({"uri": "data:;base64,AA!="}, "broken base64"),
        ({"uri": "data:;base64,AAAA"}, "claims 36 bytes"),
    ],
)
def test_what_is_no_buffer_inside_the_file_is_told_as_what_it_is(
    buffer: dict[str, Any], why: str
) -> None:
    with pytest.raises(InvalidArgument, match=why):
        of(plain(), buffers=[{"byteLength": 36, **buffer}])


def test_a_text_gltf_is_told_from_a_glb() -> None:
    with pytest.raises(InvalidArgument, match=r"export as \.glb"):
        read_glb(b'\n{"asset": {"version": "2.0"}, "buffers": []}')


def skinned(joint: dict[str, Any], inverse: np.ndarray | None, kind: str = "float32") -> np.ndarray:
    """The triangle, in centimetres, on one joint; its own node's place does not count."""
    packer = Packer()
    packer.accessor((TRIANGLE * 100).astype(np.float32))
    packer.accessor(np.zeros((3, 4), np.uint8))
    whole = 1.0 if kind == "float32" else np.iinfo(kind).max
    packer.accessor(
        (np.array([[1, 0, 0, 0]] * 3) * whole).astype(kind), normalized=kind != "float32"
    )
    skin: dict[str, Any] = {"joints": [1]}
    if inverse is not None:
        skin["inverseBindMatrices"] = packer.accessor(inverse.T.reshape(1, 16).astype(np.float32))
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    return of(
        packer,
        meshes=[{"primitives": [{"attributes": attributes}]}],
        nodes=[{"mesh": 0, "skin": 0, "translation": [99, 0, 0]}, joint],
        skins=[skin],
    )


@pytest.mark.parametrize("kind", ["float32", "uint8", "uint16"])
def test_a_skin_is_where_its_joints_are_and_its_node_is_not(kind: str) -> None:
    centimetres = {"scale": [0.01] * 3, "translation": [0, 1, 0]}
    found = skinned(centimetres, None, kind)
    np.testing.assert_allclose(found[0], TRIANGLE + np.array([0, 1, 0]), atol=1e-5)
    bound = np.diag([0.01, 0.01, 0.01, 1.0])
    np.testing.assert_allclose(skinned({}, bound, kind)[0], TRIANGLE, atol=1e-5)


@pytest.mark.parametrize("name", ["needs_webp_textures.glb", "buffer_as_data_uri.glb"])
def test_strangers_files_are_read(name: str) -> None:
    corners = read_level(MeshFile((LEVELS / name).read_bytes(), "glb"), Walkable(), ())[0]
    assert len(corners) >= 2 and np.abs(corners).max() < 100


def test_a_scene_without_nodes_has_no_mesh() -> None:
    with pytest.raises(InvalidArgument, match="no node of the scene has a mesh"):
        read_glb(glb({"asset": {"version": "2.0"}, "scenes": [{"name": "empty"}]}))
