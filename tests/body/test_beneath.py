"""Nothing comes through clothes, neither skin nor inner clothes, at rest and in a walk."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from wayfarer.body.library import load_body
from wayfarer.body.mesh import vertex_normals
from wayfarer.body.outfit import JACKET, OUTFITS, SHIRT, SKIRT, TROUSERS, look
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.body.wardrobe import dressed

WALK = json.loads((Path(__file__).parent.parent / "golden/walk.json").read_text("utf-8"))
FRAMES = (5, 20, 26, 33, 50)
COVERED_M = 0.08  # from skin to the cloth over it
THROUGH_M = (0.004, 0.025)  # outside the cloth: by less it is not seen
BENEATH = {TROUSERS: (SHIRT, JACKET), SHIRT: (JACKET, SKIRT)}  # covers of each region
OVERALLS = {SHIRT: (TROUSERS,)}  # except that their shirt is below their trousers


def poses(body):
    """The body at rest, and in frames of a walk. [6, V, 3]."""
    rest = body.rest_joints(np.zeros(10))
    turns = np.tile(np.eye(3), (1 + len(FRAMES), 22, 1, 1))
    walked = np.array([WALK["rotations"][frame] for frame in FRAMES])
    walked = Rotation.from_quat(walked.reshape(-1, 4)).as_matrix()
    walked = np.einsum("ba,jbc,cd->jad", GLTF_FROM_CORE, walked, GLTF_FROM_CORE)
    turns[1:] = walked.reshape(len(FRAMES), 22, 3, 3)
    return body.skin(np.zeros(10), *body.forward_kinematics(rest[0], turns, rest))


def first(points, ways, triangles, reach):
    """Metres to the first of the near triangles, inf beyond reach; whether from its inside."""
    _, near = KDTree(triangles.mean(1)).query(points, min(16, len(triangles)))
    a, b, c = np.moveaxis(triangles[near], 2, 0)
    normal = np.cross(b - a, c - a)
    ways = np.broadcast_to(ways[:, None], normal.shape)
    inside = (normal * ways).sum(-1)
    across = np.cross(points[:, None] - a, ways)
    with np.errstate(all="ignore"):
        u = -((c - a) * across).sum(-1) / inside
        v = ((b - a) * across).sum(-1) / inside
        t = -((points[:, None] - a) * normal).sum(-1) / inside
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < reach)
    t = np.where(met, t, np.inf)
    best = t.argmin(-1)[:, None]
    return np.take_along_axis(t, best, 1)[:, 0], np.take_along_axis(inside, best, 1)[:, 0] > 0


def through(stands, faces, cover):
    """Number of vertices under a cover at rest that come through it, per pose."""
    used = np.unique(faces)
    counts = []
    for places in stands:
        points, normals = places[used], vertex_normals(places, faces)[used]
        if not counts:
            far, leaves = first(points, normals, places[cover], COVERED_M)
            under = leaves & np.isfinite(far)
            used, points, normals = used[under], points[under], normals[under]
        far, leaves = first(points, -normals, places[cover], THROUGH_M[1])
        outside = np.flatnonzero((far > THROUGH_M[0]) & np.isfinite(far) & ~leaves)
        over, leaves = first(points[outside], normals[outside], places[cover], COVERED_M)
        counts.append(len(outside) - int((leaves & np.isfinite(over)).sum()))
    return len(used), counts


@pytest.mark.parametrize("detail", ["high", "low"])
@pytest.mark.parametrize("gender", ["female", "male"])
def test_nothing_comes_through(gender, detail):
    body = load_body("anny52", gender, detail)
    found = {}
    for outfit in OUTFITS:
        clothed, region = dressed(body, look(1, gender, outfit))
        stands = poses(clothed)[: 2 if detail == "high" else None]
        skin = (clothed.faces < len(body.bind_vertices)).all(-1)
        pairs = {"skin": (skin, ~skin & np.isin(region, (SHIRT, TROUSERS, JACKET, SKIRT)))}
        for inner, over in (OVERALLS if outfit == "overalls" else BENEATH).items():
            pairs[inner] = (~skin & (region == inner), ~skin & np.isin(region, over))
        for name, (inner, over) in pairs.items():
            if inner.any() and over.any():
                found[outfit, name] = through(stands, clothed.faces[inner], clothed.faces[over])
    assert len(found) > len(OUTFITS)
    assert all(max(counts) <= 3 for _, counts in found.values()), found
