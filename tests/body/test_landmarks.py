"""The 67 markers: their names, their places, and how they are found on a mesh."""

import numpy as np
import pytest

from wayfarer.body import landmarks
from wayfarer.body.library import load_body
from wayfarer.body.mesh import vertex_normals
from wayfarer.spec import GENDERS, MARKERS


@pytest.fixture(params=GENDERS)
def body(request):
    return load_body("anny52", request.param)


def places(body, betas=None):
    values = body.rest_vertices(np.zeros(10) if betas is None else betas, body.marker_vertices)
    return dict(zip(body.marker_names, values, strict=True))


def test_names_are_unique_and_mirror_each_other():
    names = landmarks.marker_names()
    assert len(set(names)) == len(names) == MARKERS
    assert all(landmarks.mirrored(landmarks.mirrored(name)) == name for name in names)
    assert {landmarks.mirrored(name) for name in names} == set(names)
    assert load_body("anny52", "male").marker_names == names


def test_genders_and_details_share_markers():
    male, female = (load_body("anny52", g) for g in GENDERS)
    np.testing.assert_array_equal(male.marker_vertices, female.marker_vertices)
    low = load_body("anny52", "male", "low")
    betas = np.linspace(-1, 1, 10)
    np.testing.assert_array_equal(
        low.rest_vertices(betas, low.marker_vertices),
        male.rest_vertices(betas, male.marker_vertices),
    )


def test_right_markers_mirror_left_ones(body):
    at = places(body)
    for name, place in at.items():
        mirror = at[landmarks.mirrored(name)] * [-1, 1, 1]
        np.testing.assert_allclose(place, mirror, atol=1e-3, err_msg=name)
    assert all(at[n][0] < 0 for n in at if n[0] == "L")


def test_soles_are_under_the_feet_left_first(body):
    at = places(body)
    names = [body.marker_names[k] for k in body.sole_markers]
    parts = ("HEEL", "MT1", "MT5", "TOE")
    assert names == [f"{side}SOLE_{part}" for side in "LR" for part in parts]
    assert max(abs(at[n][2]) for n in names) < 0.006
    normals = vertex_normals(body.rest_vertices(np.zeros(10)), body.faces)
    down = normals[body.marker_vertices[body.sole_markers]][:, 2]
    assert (down < -0.5).all()
    assert at["LSOLE_HEEL"][1] < at["LSOLE_MT5"][1] < at["LSOLE_MT1"][1] < at["LSOLE_TOE"][1]
    assert at["LSOLE_MT5"][0] < at["LSOLE_MT1"][0]  # the little toe is on the outer side


def test_places_are_where_their_names_say(body):
    at = places(body)
    joint = dict(zip(body.joint_names, body.rest_joints(np.zeros(10)), strict=True))
    assert at["ARIEL"][2] == pytest.approx(body.rest_vertices(np.zeros(10))[:, 2].max(), abs=5e-3)
    assert at["C7"][1] < joint["neck"][1] < at["CLAV"][1]
    assert at["T10"][1] < joint["spine2"][1] < at["STRN"][1]
    assert at["LFHD"][1] > joint["head"][1] > at["LBHD"][1]
    assert at["LKNE"][0] < joint["left_knee"][0] < at["LKNI"][0]
    assert at["LIWR"][1] > joint["left_wrist"][1] > at["LOWR"][1]
    assert at["LELB"][2] > joint["left_elbow"][2] > at["LELBIN"][2]
    assert at["LTOE"][1] > at["LMT1"][1] > at["LANK"][1] > at["LHEE"][1]


def test_markers_are_spread_out(body):
    values = np.array(list(places(body).values()))
    apart = np.linalg.norm(values[:, None] - values, axis=-1) + np.eye(MARKERS)
    assert apart.min() > 0.012


def test_finding_them_again_gives_the_shipped_ones():
    """Also on a mesh of unknown symmetry, whose sides are searched one by one."""
    bodies = [load_body("anny52", gender) for gender in GENDERS]
    none = np.zeros(10)
    mesh = np.mean([body.rest_vertices(none) for body in bodies], axis=0)
    places = np.mean([body.rest_joints(none) for body in bodies], axis=0)
    joints = dict(zip(bodies[0].joint_names, places, strict=True))
    found = landmarks.find_markers(mesh, bodies[0].faces, joints)
    central = len(landmarks.CENTRAL)
    shipped = bodies[0].marker_vertices
    np.testing.assert_array_equal(found[central:], shipped[central:])
    apart = np.linalg.norm(mesh[found[:central]] - mesh[shipped[:central]], axis=-1)
    assert apart.max() < 0.015


def test_a_ray_leaves_through_the_outermost_face():
    corners = np.array([[-9.0, -9, 0], [9, -9, 0], [0, 9, 0]])
    layers = np.concatenate([corners + np.array([0, 0, height]) for height in (1, 2)])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    np.testing.assert_allclose(landmarks.ray_exit(layers, faces, np.zeros(3), (0, 0, 5)), [0, 0, 2])
    with pytest.raises(ValueError, match="does not meet"):
        landmarks.ray_exit(layers, faces, np.zeros(3), (0, 0, -1))
