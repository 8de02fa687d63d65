"""A viewer that knows only the glTF standard must see what BodyModel computes."""

import numpy as np
import pygltflib
import pytest

from wayfarer.body.glb import body_glb
from wayfarer.body.library import load_body
from wayfarer.body.rotation import (
    GLTF_FROM_CORE,
    gltf_quaternion,
    matrix_from_quaternion,
    quaternion_from_rotvec,
)
from wayfarer.errors import InvalidArgument
from wayfarer.spec import POSED_JOINTS

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def read(document, index):
    """Values of an accessor [n, width], as the standard says."""
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


def skin(document, translations, rotations):
    """Skinned vertices as a glTF viewer computes them [V, 3]."""
    attributes = document.meshes[0].primitives[0].attributes
    places = read(document, attributes.POSITION).astype(float)
    joints, weights = read(document, attributes.JOINTS_0), read(document, attributes.WEIGHTS_0)
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


def parsed(body, betas, style=0):
    return pygltflib.GLTF2.load_from_bytes(body_glb(body, betas, style))


@pytest.mark.parametrize("gender", ["female", "male"])
@pytest.mark.parametrize("detail", ["high", "low"])
def test_skinning_of_a_random_pose_is_that_of_the_body(gender, detail):
    body = load_body("anny52", gender, detail)
    rng = np.random.default_rng(5)
    betas = rng.normal(size=10)
    quaternions = quaternion_from_rotvec(rng.normal(scale=0.5, size=(POSED_JOINTS, 3)))
    hips = rng.normal(size=3)
    turned, placed = body.forward_kinematics(
        hips, matrix_from_quaternion(quaternions), body.rest_joints(betas)
    )
    expected = body.skin(betas, turned, placed) @ GLTF_FROM_CORE.T

    document = parsed(body, betas)
    wire = gltf_quaternion(quaternions)
    found = skin(document, {0: GLTF_FROM_CORE @ hips}, dict(enumerate(wire)))

    # border vertices are doubled: compare as sets, each to its nearest
    faces = read(document, document.meshes[0].primitives[0].indices).reshape(-1, 3)
    np.testing.assert_allclose(found[faces], expected[body.faces], atol=1e-5)


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
    attributes = document.meshes[0].primitives[0].attributes
    weights = read(document, attributes.WEIGHTS_0)
    np.testing.assert_allclose(weights.sum(-1), 1, atol=1e-6)
    assert (weights >= 0).all()
    assert read(document, attributes.JOINTS_0).max() < 52
    normals = read(document, attributes.NORMAL)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)
    count = len(read(document, attributes.POSITION))
    assert read(document, document.meshes[0].primitives[0].indices).max() == count - 1
    places = read(document, attributes.POSITION).astype(float)
    triangles = places[read(document, document.meshes[0].primitives[0].indices).reshape(-1, 3)]
    litres = np.linalg.det(triangles).sum() / 6 * 1000
    assert 40 < litres < 110  # positive: faces are counter-clockwise from outside


def test_style_dresses_the_same_body_differently_and_repeatably():
    body = load_body("anny52", "female", "low")
    first, again, other = (
        read(d := parsed(body, np.zeros(10), style), d.meshes[0].primitives[0].attributes.COLOR_0)
        for style in (1, 1, 2)
    )
    assert (first == again).all()
    assert (first != other).any()
    assert len(np.unique(first, axis=0)) >= 5  # skin, hair, shirt, trousers, shoes


@pytest.mark.parametrize("betas", [np.zeros(9), np.full(10, np.nan), np.full(10, 6.0)])
def test_bad_betas_are_refused(betas):
    with pytest.raises(InvalidArgument, match="beta"):
        body_glb(load_body("anny52", "female", "low"), betas)
