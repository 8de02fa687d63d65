"""Fingers at rest are curled a little, like those of a hanging hand."""

from dataclasses import replace

import numpy as np
import pytest

from wayfarer.body import skeleton
from wayfarer.body.hands import CURL, relaxed
from wayfarer.body.library import body_file, load_arrays, load_body
from wayfarer.spec import GENDERS, POSED_JOINTS

MIRROR = np.diag([-1.0, 1.0, 1.0])


@pytest.fixture(params=GENDERS)
def gender(request):
    return request.param


def modelled(gender):
    """The turns in the body's file: fingers as modelled."""
    return load_arrays(body_file("anny52", gender))["bind_to_rest"].astype(np.float64)


def bends(body, turns):
    """Degrees between each finger's knuckle bone and its outer one."""
    place = {name: k for k, name in enumerate(body.joint_names)}
    found = {}
    for name in body.joint_names:
        if name[-1] == "1" and name.split("_")[-1][:-1] in CURL:
            chain = [place[name[:-1] + str(k)] for k in (1, 2, 3)]
            bones = np.diff(body.bind_joints[chain], axis=0)
            inner, outer = turns[chain[0]] @ bones[0], turns[chain[1]] @ bones[1]
            cosine = inner @ outer / np.linalg.norm(inner) / np.linalg.norm(outer)
            found[name] = np.degrees(np.arccos(cosine))
    return found


def test_only_fingers_are_turned(gender):
    body = load_body("anny52", gender)
    np.testing.assert_array_equal(body.bind_to_rest[:POSED_JOINTS], modelled(gender)[:POSED_JOINTS])
    np.testing.assert_allclose(np.linalg.det(body.bind_to_rest), 1.0, atol=1e-6)


def test_every_finger_is_bent_more_and_stays_within_reach_of_a_hand(gender):
    body = load_body("anny52", gender)
    before, after = bends(body, modelled(gender)), bends(body, body.bind_to_rest)
    assert len(after) == 10
    for name, angle in after.items():
        assert before[name] + 3 < angle < 60, name


def test_both_hands_are_alike(gender):
    body = load_body("anny52", gender)
    turns = relaxed(body.joint_names, body.bind_joints, modelled(gender))
    for number, name in enumerate(body.joint_names):
        other = turns[body.joint_names.index(skeleton.mirrored(name))]
        np.testing.assert_allclose(turns[number], MIRROR @ other @ MIRROR, atol=1e-4)


def test_tips_go_to_the_palm(gender):
    body = load_body("anny52", gender)
    rest = dict(zip(body.joint_names, body.rest_joints(np.zeros(10)), strict=True))
    for finger in ("index", "middle", "ring", "pinky"):
        assert rest[f"left_{finger}3"][2] < rest[f"left_{finger}1"][2] - 0.01  # palms face down


def test_markers_hardly_move(gender):
    """Models were trained with fingers as modelled: their markers must still be those."""
    body = load_body("anny52", gender, "low")
    straight = replace(body, bind_to_rest=modelled(gender))
    curled, before = (
        one.rest_vertices(np.zeros(10), one.marker_vertices) for one in (body, straight)
    )
    assert np.linalg.norm(curled - before, axis=-1).max() < 0.002
