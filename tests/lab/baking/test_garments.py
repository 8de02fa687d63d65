"""A made garment: read, bound to the base mesh, simplified and baked."""

import numpy as np
import pytest

from wayfarer.body.outfit import SHIRT, TRIM
from wayfarer.body.wardrobe import DIRECTION_M, PLACE_M
from wayfarer.errors import DataError
from wayfarer_lab.baking.garments import BASE_VERTICES, FROM_MAKEHUMAN, connected, read_garment
from wayfarer_lab.baking.simplify import alike, simplified
from wayfarer_lab.baking.wardrobe import Recipe, baked, part, shorten

HEADER = "obj_file made.obj\nx_scale 0 1 2.0\ny_scale 0 2 4.0\nz_scale 0 3 1.0\nverts 0\n"
BOUND = "4\n5\n0 1 2 0.2 0.3 0.5 0.1 0.2 0.3\n4 5 6 0.5 0.5 0.0 0 0 0\n"
MESH = """v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0
vt 0 0
vt 1 0
vt 0 1
vt 0.5 0.5
vt 0.6 0.5
vt 0.5 0.6
f 1/1 2/2 3/3
f 2/4 4/5 3/6
"""
HIDES = "material made.mhmat\ndelete_verts\n7 9 - 11 20\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "made.mhclo").write_text(HEADER + BOUND + HIDES)
    (tmp_path / "made.obj").write_text(MESH)
    return tmp_path


def base_mesh(seed=1):
    return np.random.default_rng(seed).normal(size=(BASE_VERTICES, 3))


def test_a_garment_is_read(folder):
    garment = read_garment(folder / "made.mhclo")
    assert garment.faces.tolist() == [[0, 1, 2], [1, 3, 2]]
    assert garment.islands.tolist() == [0, 1], "they share vertices, but not in the texture"
    assert garment.hides.tolist() == [7, 9, 10, 11, 20]
    assert garment.scales == ((0, 1, 2.0), (0, 2, 4.0), (0, 3, 1.0))


def test_vertices_lie_where_makehuman_puts_them(folder):
    """Weights times three vertices, and an offset that grows with the body."""
    base = base_mesh()
    placed = read_garment(folder / "made.mhclo").place(base)
    np.testing.assert_allclose(placed[:2], base[4:6])
    seen = base @ FROM_MAKEHUMAN  # in MakeHuman's axes
    size = np.abs([seen[0, k] - seen[k + 1, k] for k in range(3)]) / [2.0, 4.0, 1.0]
    wanted = 0.2 * seen[0] + 0.3 * seen[1] + 0.5 * seen[2] + [0.1, 0.2, 0.3] * size
    np.testing.assert_allclose(placed[2] @ FROM_MAKEHUMAN, wanted)


def test_directions_are_what_places_change_by(folder):
    garment, base = read_garment(folder / "made.mhclo"), base_mesh()
    changes = np.stack([base_mesh(seed) for seed in (2, 3)], -1)
    step = np.array([1e-6, -2e-6])
    found = garment.place(base + changes @ step) - garment.place(base)
    np.testing.assert_allclose(found, garment.directions(changes, base) @ step, atol=1e-12)


def test_skin_weights_are_those_of_what_it_is_bound_to(folder):
    weights = np.random.default_rng(4).random((BASE_VERTICES, 52))
    weights /= weights.sum(-1, keepdims=True)
    own = read_garment(folder / "made.mhclo").skin_weights(weights)
    np.testing.assert_allclose(own[0], weights[4])
    np.testing.assert_allclose(own[3], (weights[4] + weights[5]) / 2)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("made.mhclo", HEADER, "no bound vertices"),
        ("made.mhclo", HEADER + BOUND + "1 2 3\n", "1 or 9 numbers, not 3"),
        ("made.mhclo", HEADER + BOUND + "19158\n", "4|5 vertices|beyond"),
        ("made.mhclo", "verts 0\n" + BOUND, "names no obj_file"),
        ("made.mhclo", HEADER.replace("x_scale 0 1 2.0", "x_scale 0 1") + BOUND, "x_scale must be"),
        ("made.obj", MESH.replace("f 2/4 4/5 3/6", "f 2/4 9/5 3/6"), "not a mesh"),
        ("made.obj", MESH + "v 0 0 1\n", "4 vertices are bound, its mesh has 5"),
        ("made.obj", "v 0 0 0\nf 1 1 1\n", "texture coordinates"),
    ],
)
def test_what_is_wrong_is_named(folder, file, text, message):
    (folder / file).write_text(text)
    with pytest.raises(DataError, match=message):
        read_garment(folder / "made.mhclo")


def sheet(rows=24):
    """A square of 1 m, and faces of it."""
    x, y = np.meshgrid(*[np.linspace(0, 1, rows + 1)] * 2, indexing="ij")
    vertices = np.stack([x, y, 0.1 * np.sin(3 * x)], -1).reshape(-1, 3)
    i, j = (v.reshape(-1) for v in np.meshgrid(*[np.arange(rows)] * 2, indexing="ij"))
    at = i * (rows + 1) + j
    a, b, c, d = at, at + rows + 1, at + rows + 2, at + 1
    return vertices, np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])


def test_a_simpler_mesh_lies_on_the_finer_one_and_keeps_its_hems():
    pytest.importorskip("pyfqmr")
    vertices, faces = sheet()
    coarse = simplified(vertices, faces, 300)
    assert len(coarse.faces) < 330
    np.testing.assert_allclose(coarse.shares.sum(-1), 1)
    placed = np.einsum("vk,vkc->vc", coarse.shares, vertices[coarse.corners])
    for edge in (0.0, 1.0):
        assert (np.abs(placed[:, 1] - edge) < 1e-6).sum() == 25
    np.testing.assert_allclose(placed[:, 2], 0.1 * np.sin(3 * placed[:, 0]), atol=0.002)


def test_a_garment_is_baked_for_each_gender(folder):
    recipe = Recipe("made", SHIRT, {TRIM: (1,)}, floor=True)
    bases = {
        gender: (base_mesh(seed), np.zeros((BASE_VERTICES, 3, 10)))
        for seed, gender in enumerate(recipe.genders)
    }
    weights = np.eye(52)[np.arange(BASE_VERTICES) % 52]
    garment = read_garment(folder / "made.mhclo")
    arrays, surfaces = baked("made", garment, recipe, bases, weights, {})
    assert surfaces["low"].faces.shape == (2, 3)
    for gender, (base, _) in bases.items():
        places = garment.place(base)
        found = arrays[f"made/low/{gender}/vertices"] * PLACE_M
        np.testing.assert_allclose(found[:, :2], places[:, :2], atol=PLACE_M)
        np.testing.assert_allclose(found[:, 2], places[:, 2].clip(0), atol=PLACE_M)
        assert not (arrays[f"made/high/{gender}/vertices_dirs"] * DIRECTION_M).any()
    assert arrays["made/low/regions"].tolist() == [SHIRT, TRIM]
    assert arrays["made/low/skin_joints"][0, 0] == 4


def test_long_hair_is_drawn_up_below_the_chin():
    places = np.array([[0, 0, 1.7], [0, 0, 1.6], [0, 0, 1.0]])
    directions = np.full((3, 3, 10), 0.01)
    directions[2, 2] = 0.03
    shorten(places, directions, 0.5)
    np.testing.assert_allclose(places[:, 2], [1.7, 1.6, 1.24])  # chin at 1.48
    np.testing.assert_allclose(directions[:, 2, 0], [0.01, 0.01, 0.02])


def test_pieces_are_numbered_in_their_order():
    assert connected(np.array([[5, 6, 7], [0, 1, 2], [6, 7, 8]])).tolist() == [0, 1, 0]


def test_layers_are_simplified_apart():
    """Where two lie on each other, each face belongs to only one."""
    pytest.importorskip("pyfqmr")
    vertices, faces = sheet()
    both = np.concatenate([faces, faces + len(vertices)])
    region = np.repeat([SHIRT, TRIM], len(faces))
    double = np.concatenate([vertices, vertices + np.array([0, 0, 1e-4])])
    coarse = simplified(double, both, 600, group=alike(both, region))
    own = region[coarse.source]
    assert ((coarse.corners[coarse.faces] < len(vertices)).all((1, 2)) == (own == SHIRT)).all()


def test_hair_over_a_face_is_drawn_up():
    places = np.array([[0, 0.0, 1.7], [0, 0.17, 1.5], [0, 0.0, 1.5]])
    directions = np.zeros((3, 3, 10))
    part(places, directions)
    np.testing.assert_allclose(places[:, 2], [1.7, 1.62 - 0.2 * 0.12, 1.5])  # brow at 1.62
