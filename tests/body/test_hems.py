"""Cutting a body along the hems changes its triangles' garments, and not its form."""

from collections import Counter

import numpy as np
import pytest

from wayfarer.body.hems import painted
from wayfarer.body.library import load_body
from wayfarer.body.mesh import vertex_normals
from wayfarer.body.outfit import SHIRT, SHOES, TROUSERS, regions

BODIES = [(gender, detail) for gender in ("female", "male") for detail in ("high", "low")]


@pytest.fixture(params=BODIES, ids="-".join)
def body(request):
    return load_body("anny52", *request.param)


def sides(faces):
    """Directed edges [3F, 2] of all triangles, one corner after the other."""
    return np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2)


def hem(body, worn, above, below):
    """Places [n, 2, 3] of the ends of the edges between two garments."""
    wears = dict(zip(map(tuple, sides(body.faces)), worn.repeat(3), strict=True))
    edges = [
        edge for edge, region in wears.items() if region == above and wears.get(edge[::-1]) == below
    ]
    return body.bind_vertices[np.array(edges)]


def areas(body, worn):
    a, b, c = np.moveaxis(body.bind_vertices[body.faces], 1, 0)
    return np.bincount(worn, np.linalg.norm(np.cross(b - a, c - a), axis=-1) / 2)


def test_hems_are_more_even_than_the_edges_of_a_light_mesh():
    for gender in ("female", "male"):
        body = load_body("anny52", gender, "low")
        for above, below in ((SHIRT, TROUSERS), (TROUSERS, SHOES)):
            cut, worn = painted(body)
            teeth = hem(body, regions(body)[body.faces].max(-1), above, below)
            even = hem(cut, worn, above, below)
            assert np.ptp(even[..., 2]) < 0.75 * np.ptp(teeth[..., 2])

            def steepness(ends):
                rise = np.abs(np.diff(ends[..., 2], axis=1)).sum()
                return rise / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1).sum()

            assert steepness(even) < 0.9 * steepness(teeth), (gender, above)


def test_the_surface_stays_whole_and_as_it_was(body):
    cut, worn = painted(body)
    assert set(Counter(map(tuple, sides(cut.faces))).values()) == {1}, "no triangle lies twice"
    ways = {tuple(edge) for edge in sides(body.faces)}
    rim = sum((b, a) not in ways for a, b in ways)
    ways = {tuple(edge) for edge in sides(cut.faces)}
    assert sum((b, a) not in ways for a, b in ways) == rim, "no gap opens along a cut"
    before = areas(body, regions(body)[body.faces].max(-1))
    after = areas(cut, worn)
    assert np.isclose(after.sum(), before.sum(), rtol=1e-9)
    assert len(after) == len(before)
    np.testing.assert_allclose(after, before, atol=0.06)  # m2; hems move by half a triangle
    old = vertex_normals(body.bind_vertices, body.faces)
    new = vertex_normals(cut.bind_vertices, cut.faces)[: len(old)]
    used = np.unique(body.faces)
    cosine = (new * old).sum(-1)[used]  # pieces have another area: normals move a little
    assert np.quantile(cosine, 0.005) > 0.95
    assert len(cut.bind_vertices) < 1.25 * len(body.bind_vertices)


def test_new_vertices_move_with_those_they_lie_between(body):
    cut, _ = painted(body)
    count = len(body.bind_vertices)
    for name in ("bind_vertices", "bind_vertices_dirs", "skin_joints", "skin_weights", "regions"):
        np.testing.assert_array_equal(getattr(cut, name)[:count], getattr(body, name))
    np.testing.assert_allclose(cut.skin_weights.sum(-1), 1, atol=1e-6)
    assert cut.faces.max() == len(cut.bind_vertices) - 1
    assert cut.uv_faces.shape == cut.faces.shape
    assert cut.uv_faces.max() == len(cut.uvs) - 1
    assert painted(body)[0] is cut, "made once"
