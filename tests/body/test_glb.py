"""A viewer that knows only the glTF standard must see what BodyModel computes."""

from dataclasses import replace

import numpy as np
import pygltflib
import pytest
from scipy.spatial import cKDTree

from wayfarer.body.glb import body_glb
from wayfarer.body.library import load_body
from wayfarer.body.outfit import BARE, OUTFITS, REGIONS, look
from wayfarer.body.rotation import (
    GLTF_FROM_CORE,
    gltf_quaternion,
    matrix_from_quaternion,
    quaternion_from_rotvec,
)
from wayfarer.body.wardrobe import dressed
from wayfarer.errors import InvalidArgument
from wayfarer.spec import POSED_JOINTS

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def read(document, index):
    """Values of an accessor [n, width], by the standard."""
    accessor = document.accessors[index]
    view = document.bufferViews[accessor.bufferView]
    dtype, width = COMPONENTS[accessor.componentType], WIDTHS[accessor.type]
    start = view.byteOffset + (accessor.byteOffset or 0)
    assert start % np.dtype(dtype).itemsize == 0
    assert accessor.count * width * np.dtype(dtype).itemsize <= view.byteLength
    flat = np.frombuffer(document.binary_blob(), dtype, accessor.count * width, start)
    values = flat.reshape(accessor.count, width)
    if accessor.min:
        np.testing.assert_allclose(values.min(0), accessor.min, rtol=1e-6)
        np.testing.assert_allclose(values.max(0), accessor.max, rtol=1e-6)
    return values


def world_matrices(document, translations, rotations):
    """Global transform of every node [n, 4, 4]; both dicts override the nodes' own values."""
    globals_ = {}

    def visit(index, parent):
        node = document.nodes[index]
        local = np.eye(4)
        local[:3, :3] = matrix_from_quaternion(
            np.array(rotations.get(index, node.rotation or (0, 0, 0, 1)), float)
        )
        local[:3, 3] = translations.get(index, node.translation or (0, 0, 0))
        globals_[index] = parent @ local
        for child in node.children:
            visit(child, globals_[index])

    for root in document.scenes[document.scene].nodes:
        visit(root, np.eye(4))
    return globals_


def values(document, attribute):
    """Values of all primitives, end to end [V, width]."""
    primitives = document.meshes[0].primitives
    return np.concatenate([read(document, getattr(p.attributes, attribute)) for p in primitives])


def triangles(document):
    """Corners of all primitives [F, 3], rows of `values`."""
    found, first = [], 0
    for primitive in document.meshes[0].primitives:
        corners = read(document, primitive.indices).reshape(-1, 3).astype(int)
        count = document.accessors[primitive.attributes.POSITION].count
        assert corners.max() == count - 1
        found.append(corners + first)
        first += count
    return np.concatenate(found)


def worn_by(body, style=0, outfit=""):
    """The dressed body, and the region of each triangle."""
    return dressed(body, look(style, body.gender, outfit))


def in_file_order(body):
    """Triangles of the dressed body as a file has them: one region after the other."""
    return np.argsort(worn_by(body)[1], kind="stable")


def skin(document, translations, rotations):
    """Skinned vertices as a glTF viewer computes them [V, 3]."""
    places = values(document, "POSITION").astype(float)
    joints, weights = values(document, "JOINTS_0"), values(document, "WEIGHTS_0")
    inverse = read(document, document.skins[0].inverseBindMatrices).reshape(-1, 4, 4)
    matrices = world_matrices(document, translations, rotations)
    chain = np.stack(
        [
            matrices[node] @ inverse[k].T.astype(float)  # stored by columns
            for k, node in enumerate(document.skins[0].joints)
        ]
    )
    blended = np.einsum("vk,vkab->vab", weights.astype(float), chain[joints])
    homogeneous = np.concatenate([places, np.ones((len(places), 1))], -1)
    return np.einsum("vab,vb->va", blended, homogeneous)[:, :3]


def parsed(body, betas, style=0, outfit=""):
    return pygltflib.GLTF2.load_from_bytes(body_glb(body, betas, style, outfit))


@pytest.mark.parametrize("gender", ["female", "male"])
@pytest.mark.parametrize("detail", ["high", "low"])
def test_skinning_of_a_random_pose_is_that_of_the_body(gender, detail):
    bare = load_body("anny52", gender, detail)
    body, _ = worn_by(bare)
    rng = np.random.default_rng(5)
    betas = rng.normal(size=10)
    quaternions = quaternion_from_rotvec(rng.normal(scale=0.5, size=(POSED_JOINTS, 3)))
    hips = rng.normal(size=3)
    turned, placed = body.forward_kinematics(
        hips, matrix_from_quaternion(quaternions), body.rest_joints(betas)
    )
    expected = body.skin(betas, turned, placed) @ GLTF_FROM_CORE.T

    document = parsed(bare, betas)
    wire = gltf_quaternion(quaternions)
    found = skin(document, {0: GLTF_FROM_CORE @ hips}, dict(enumerate(wire)))

    # vertices at borders and seams are doubled: compare corner by corner
    faces = body.faces[in_file_order(bare)]
    np.testing.assert_allclose(found[triangles(document)], expected[faces], atol=1e-5)


def test_rest_pose_is_the_t_pose_with_feet_on_the_floor():
    body = load_body("anny52", "female", "low")
    document = parsed(body, np.zeros(10))
    assert all(node.rotation is None for node in document.nodes)
    vertices = skin(document, {}, {})
    assert abs(vertices[:, 1].min()) < 0.03  # Y is up
    assert 1.5 < vertices[:, 1].max() < 1.85
    names = [node.name for node in document.nodes]
    places = world_matrices(document, {}, {})
    assert places[names.index("left_wrist")][0, 3] > 0.5  # left is +X
    toes, heel = (places[names.index(name)][2, 3] for name in ("left_foot", "left_ankle"))
    assert toes > heel + 0.05  # faces +Z


def test_joint_nodes_are_the_52_canonical_names_in_order():
    body = load_body("anny52", "male", "low")
    document = parsed(body, np.zeros(10))
    assert [document.nodes[j].name for j in document.skins[0].joints] == list(body.joint_names)
    parent_of = {child: i for i, node in enumerate(document.nodes) for child in node.children}
    assert [parent_of.get(j, -1) for j in range(52)] == body.parents.tolist()


def test_mesh_attributes_are_valid():
    document = parsed(load_body("anny52", "female", "high"), np.zeros(10))
    weights, joints = values(document, "WEIGHTS_0"), values(document, "JOINTS_0")
    np.testing.assert_allclose(weights.sum(-1), 1, atol=1e-6)
    assert (weights >= 0).all() and joints.max() < 52
    assert (weights == 0).any() and not joints[weights == 0].any()
    normals = values(document, "NORMAL")
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)
    bare = parsed(load_body("anny52", "female", "high"), np.zeros(10), outfit=BARE)
    corners = values(bare, "POSITION").astype(float)[triangles(bare)]
    litres = np.linalg.det(corners).sum() / 6 * 1000
    assert 40 < litres < 110  # positive: faces are counter-clockwise from outside


@pytest.mark.parametrize("outfit", [*OUTFITS, BARE])
@pytest.mark.parametrize("detail", ["high", "low"])
def test_every_region_is_a_slot_for_a_material(detail, outfit):
    body = load_body("anny52", "male", detail)
    document = parsed(body, np.zeros(10), outfit=outfit)
    slots = [document.materials[p.material].name for p in document.meshes[0].primitives]
    counts = [document.accessors[p.indices].count // 3 for p in document.meshes[0].primitives]
    worn = np.bincount(worn_by(body, outfit=outfit)[1], minlength=len(REGIONS)).tolist()
    assert dict(zip(slots, counts, strict=True)) == {
        name: count for name, count in zip(REGIONS, worn, strict=True) if count
    }
    assert document.extras["outfit"] == outfit


@pytest.mark.parametrize("outfit", OUTFITS)
@pytest.mark.parametrize("gender", ["female", "male"])
def test_a_dressed_body_is_three_megabytes_at_most(gender, outfit):
    body = load_body("anny52", gender, "high")
    assert max(len(body_glb(body, np.zeros(10), style, outfit)) for style in range(4)) < 3e6


@pytest.mark.parametrize("gender", ["female", "male"])
@pytest.mark.parametrize("detail", ["high", "low"])
def test_texture_coordinates_are_those_of_the_body(gender, detail):
    body = load_body("anny52", gender, detail)
    document = parsed(body, np.zeros(10))
    worn, region = worn_by(body)
    for primitive in document.meshes[0].primitives:
        own = region == REGIONS.index(document.materials[primitive.material].name)
        if (worn.uv_faces[own] < 0).any():
            assert primitive.attributes.TEXCOORD_0 is None, "clothes have none"
            continue
        corners = read(document, primitive.indices).reshape(-1, 3).astype(int)
        found = read(document, primitive.attributes.TEXCOORD_0)[corners] / 65_535
        np.testing.assert_allclose(found, worn.uvs[worn.uv_faces[own]], atol=1e-5)


def test_one_texture_fits_both_details():
    """A point on the low-poly mesh has about the coordinates of the nearest on the full one."""
    high, low = (load_body("anny52", "female", detail) for detail in ("high", "low"))
    middles, near = (body.bind_vertices[body.faces].mean(1) for body in (high, low))
    uvs, found = (body.uvs[body.uv_faces].mean(1) for body in (high, low))
    _, nearest = cKDTree(middles).query(near)
    off = np.linalg.norm(uvs[nearest] - found, axis=-1)
    assert np.median(off) < 0.01 and np.quantile(off, 0.9) < 0.04


def test_style_dresses_the_same_body_differently_and_repeatably():
    body = load_body("anny52", "female", "low")
    first, again, other = (
        [m.pbrMetallicRoughness.baseColorFactor for m in parsed(body, np.zeros(10), s).materials]
        for s in (1, 1, 2)
    )
    assert first == again != other
    assert len({tuple(colour) for colour in first}) >= 5  # skin, hair, shirt, trousers, shoes


def test_a_body_without_texture_coordinates_has_none_in_its_file():
    body = replace(load_body("anny52", "female", "low"), uvs=None, uv_faces=None)
    document = parsed(body, np.zeros(10))
    assert all(p.attributes.TEXCOORD_0 is None for p in document.meshes[0].primitives)


@pytest.mark.parametrize("betas", [np.zeros(9), np.full(10, np.nan), np.full(10, 6.0)])
def test_bad_betas_are_refused(betas):
    with pytest.raises(InvalidArgument, match="beta"):
        body_glb(load_body("anny52", "female", "low"), betas)
