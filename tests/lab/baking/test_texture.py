"""Texture coordinates handed from one mesh to another of the same shape."""

import numpy as np

from wayfarer_lab.baking.texture import Mapped, TextureMesh, texture_arrays, transferred


def tube(around: int, along: int) -> tuple[Mapped, np.ndarray]:
    """A tube of radius 0.1 m and length 1 m, cut open along its side; its true coordinates."""
    turn, up = np.meshgrid(np.arange(around), np.arange(along + 1), indexing="ij")
    angle = 2 * np.pi * turn / around
    vertices = np.stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), up / along], -1).reshape(-1, 3)
    i, j = (v.reshape(-1) for v in np.meshgrid(np.arange(around), np.arange(along), indexing="ij"))
    rows = along + 1
    quads = [(0, 0), (1, 0), (1, 1), (0, 1)]
    place = np.stack([(i + a) % around * rows + j + b for a, b in quads], -1)
    open_ = np.stack([(i + a) * rows + j + b for a, b in quads], -1)
    faces, uv_faces = (np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]]) for q in (place, open_))
    u, v = np.meshgrid(np.arange(around + 1) / around, np.arange(along + 1) / along, indexing="ij")
    uvs = np.stack([u, v], -1).reshape(-1, 2)
    return Mapped(vertices, faces, uvs, uv_faces), uvs[uv_faces]


def test_no_face_is_torn_at_a_seam():
    full, _ = tube(48, 40)
    coarse, truth = tube(8, 5)
    uvs, uv_faces = transferred(full, TextureMesh(coarse.vertices, coarse.faces))
    np.testing.assert_allclose(uvs[uv_faces], truth, atol=0.01)


def test_a_surface_inside_is_not_taken_for_the_one_outside():
    """For example in an eye, both lie at the low-poly mesh, and face opposite ways."""
    full, _ = tube(48, 40)
    inside = 0.999 * full.vertices * [1, 1, 0] + full.vertices * [0, 0, 1]
    both = Mapped(
        np.concatenate([full.vertices, inside]),
        np.concatenate([full.faces, full.faces[:, ::-1] + len(inside)]),
        np.concatenate([full.uvs, full.uvs + 5.0]),
        np.concatenate([full.uv_faces, full.uv_faces[:, ::-1] + len(full.uvs)]),
    )
    coarse, truth = tube(8, 5)
    uvs, uv_faces = transferred(both, TextureMesh(coarse.vertices, coarse.faces))
    np.testing.assert_allclose(uvs[uv_faces], truth, atol=0.01)


def test_what_is_baked_has_its_origin_at_the_upper_left_and_nothing_unused():
    full, truth = tube(12, 5)
    spare = Mapped(full.vertices, full.faces, np.append(full.uvs, [[9.0, 9.0]], 0), full.uv_faces)
    made = texture_arrays(spare, TextureMesh(full.vertices, full.faces))
    flipped = truth * [1, -1] + [0, 1]
    np.testing.assert_allclose(made["uvs"][made["uv_faces"]], flipped, atol=1e-6)
    np.testing.assert_allclose(made["low_uvs"][made["low_uv_faces"]], flipped, atol=1e-5)
    assert made["uvs"].max() <= 1
