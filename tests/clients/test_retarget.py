"""Characters of any skeleton: rigs made from our own body (tests/golden/rigs.py)."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.clients.rig_errors import Walk, errors, rigs
from tests.golden.rigs import Body, cases, foreign_rigs, offsets_of
from wayfarer_client.bases import BASES
from wayfarer_client.bone_map import map_bones
from wayfarer_client.errors import InvalidArgument
from wayfarer_client.joints import LEGS
from wayfarer_client.quaternions import arc, from_axes, inverse, multiply, rotate
from wayfarer_client.retarget import Retarget
from wayfarer_client.rig import BONES, PARENTS, Node, Rig
from wayfarer_client.soles import Soles

WALK_FILE = Path(__file__).parents[1] / "golden" / "walk.json"
WALK = json.loads(WALK_FILE.read_text())
OFFSETS = np.array(WALK["rest_offsets"]).reshape(-1, 3)
FRAMES = [
    (np.array(hips), np.array(turns).reshape(-1, 4), bits)
    for hips, turns, bits in zip(WALK["hips"], WALK["rotations"], WALK["contacts"], strict=True)
]
RIGS = rigs()
GLTF = [case for case in cases() if case.gltf]
each = pytest.mark.parametrize("case", GLTF, ids=lambda case: case.name)


def retarget_to(case) -> Retarget:
    return Retarget(map_bones(case.rig, case.humanoid), OFFSETS)


def source_places(hips, turns):
    places, worlds = [hips], [turns[0]]
    for bone in range(1, len(BONES)):
        above = PARENTS[bone]
        places.append(places[above] + rotate(worlds[above], OFFSETS[bone]))
        worlds.append(multiply(worlds[above], turns[bone]))
    return np.array(places)


def test_our_own_skeleton_moves_as_the_agent():
    retarget = retarget_to(GLTF[0])
    assert retarget.ratio == pytest.approx(1, abs=1e-4)
    for hips, turns, _ in FRAMES:
        pose = retarget.pose(hips, turns)
        wanted = source_places(hips, turns)
        found = np.array([pose.places[bone] for bone in range(len(BONES))])
        assert np.abs(found - wanted).max() < 0.002


@pytest.mark.parametrize("name", RIGS)
def test_how_well_rigs_follow_the_agent(name):
    """Feet are within 2 cm, hips within 2 %. Standing feet stay. Limbs point like the agent's."""
    retarget = Retarget(RIGS[name], OFFSETS)
    found = errors(retarget, Walk.golden())
    assert found.foot_height < 0.02 and found.hips < 0.02
    assert found.slide < 0.012
    assert found.arms < 1 and found.legs < 20 and found.upright > 0.98


def test_a_leg_that_is_too_short_does_not_jump():
    """From frame to frame its ankle moves about as far as the agent's, and hips sink smoothly;
    its heel rises a little.
    """
    walk, retarget = Walk.golden(), Retarget(RIGS["mixamo"], OFFSETS)
    last, rises = None, []
    for frame, (hips, turns, _) in enumerate(FRAMES):
        pose, (own, worlds) = retarget.pose(hips, turns, ground=0.0), walk.places(frame)
        rises.append([risen(pose, retarget, worlds, ankle) for ankle in (7, 8)])
        at = {bone: (pose.places[bone], own[bone]) for bone in (1, 7, 8)}
        for bone, (place, agents) in at.items():
            if last:
                moved, wanted = place - last[bone][0], agents - last[bone][1]
                assert np.linalg.norm(moved - wanted) < 0.03
        last = at
    assert 0.05 < np.max(rises) < 0.25


def test_a_knee_does_not_snap_where_its_foot_comes_within_reach():
    """Legs that are 10 % shorter than the agent's: a knee turns within a frame by hardly more than
    the agent's does.
    """
    walk, retarget = Walk.golden(), Retarget(RIGS["mixamo"], OFFSETS)
    knees = []
    for frame, (hips, turns, _) in enumerate(FRAMES):
        found = retarget.pose(hips, turns, ground=0.0).places
        knees.append([[bend(at, leg) for leg in LEGS] for at in (found, walk.places(frame)[0])])
    own, agents = np.abs(np.diff(knees, axis=0)).max((0, 2))
    assert own < agents + 5, (own, agents)


def bend(places, leg) -> float:
    """Degrees of a knee."""
    hip, knee, ankle, _ = (places[bone] for bone in leg)
    thigh, shin = knee - hip, ankle - knee
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(thigh, shin)), thigh @ shin)))


@pytest.mark.parametrize("longer", [0.0, 0.06])
def test_a_long_shoe_bends_at_the_ball(longer):
    """Its ankle is hardly higher for that, and a shoe that is not longer does not bend."""
    bones, walk = RIGS["own"], Walk.golden()
    plain = Retarget(bones, OFFSETS)
    feet = [(foot.fixed, foot.toes + longer * BASES["gltf"].forward) for foot in plain.foot]
    retarget = Retarget(bones, OFFSETS, soles=Soles(0.0, (feet[0], feet[1])))
    bent, lifted = [0.0], [0.0]
    for frame, (hips, turns, _) in enumerate(FRAMES):
        pose, other = (made.pose(hips, turns, ground=0.0) for made in (retarget, plain))
        for *_, ankle, toe in LEGS:
            bent.append(risen(pose, retarget, walk.places(frame)[1], toe))
            lifted.append(float(pose.places[ankle][1] - other.places[ankle][1]))
    assert max(lifted) < 0.5 * longer + 1e-6
    assert (max(bent) < 0.01) if longer == 0 else (0.2 < max(bent) < 0.51)


def risen(pose, retarget, worlds, ankle) -> float:
    """Radians by which a foot, or its toes, is turned otherwise than the agent's."""
    turned = multiply(pose.rotations[ankle], inverse(retarget.rest[ankle]))
    between = multiply(turned, inverse(worlds[ankle]))
    return float(2 * np.arctan2(np.linalg.norm(between[:3]), abs(between[3])))


@each
def test_local_rotations_give_the_same_places_through_the_files_own_nodes(case):
    """The result equals an engine's from local rotations, including twist bones and scales."""
    bones = map_bones(case.rig, case.humanoid)
    pose = Retarget(bones, OFFSETS).pose(*FRAMES[20][:2])
    nodes = list(case.rig.nodes)
    for bone, node in bones.bones.items():
        number = BONES.index(bone)
        position = pose.moved.get(number, nodes[node].position)
        nodes[node] = Node(
            nodes[node].name, nodes[node].parent, position, pose.local[number], nodes[node].scale
        )
    posed = Rig(tuple(nodes))
    for bone, node in bones.bones.items():
        np.testing.assert_allclose(posed.places[node], pose.places[BONES.index(bone)], atol=1e-9)


def test_a_map_can_be_shown_and_corrected():
    rig = Body(OFFSETS).rig()
    bones = map_bones(rig)
    assert bones.table()["left_knee"] == "left_knee" and bones.missing == ()
    other = bones.corrected({"spine2": None, "neck": "head", "head": None})
    assert other.missing == ("spine2", "head") and other.found_by == "user"
    assert other.table()["neck"] == "head"
    with pytest.raises(InvalidArgument, match="no node 'nose'"):
        bones.corrected({"head": "nose"})
    with pytest.raises(InvalidArgument, match="'tail' is no bone"):
        bones.corrected({"tail": "head"})
    with pytest.raises(InvalidArgument, match="no node was found for left_knee"):
        bones.corrected({"left_knee": None})
    with pytest.raises(InvalidArgument, match="left_knee: 'head' hangs from neck"):
        bones.corrected({"left_knee": "head", "head": None})
    with pytest.raises(InvalidArgument, match="left_knee: 'head' is head, too"):
        bones.corrected({"left_knee": "head"})
    with pytest.raises(InvalidArgument, match="hangs from"):
        bones.corrected({"spine3": "head", "head": "spine3"})


def test_a_map_that_failed_is_completed_by_corrections():
    legs = {"left_hip": "a", "left_knee": "b"}
    rig = Body(OFFSETS, names=lambda bone: legs.get(bone, bone)).rig()
    flat = Rig(tuple(replace(node, position=(0, 0, 0)) for node in rig.nodes))  # nor by shape
    with pytest.raises(InvalidArgument, match="found for left_hip, left_knee, neither"):
        map_bones(flat)
    with pytest.raises(InvalidArgument, match="found for left_knee, neither"):
        map_bones(flat, correct={"left_hip": "a"})
    found = map_bones(flat, correct=legs)
    assert found.found_by == "user" and found.missing == ()
    assert found.table()["left_knee"] == "b" and found.table()["right_knee"] == "right_knee"


def test_what_is_no_humanoid_is_refused_in_words():
    table = Rig((Node("table", -1), Node("leg1", 0, (0, -1, 0)), Node("leg2", 0, (1, -1, 0))))
    with pytest.raises(InvalidArgument, match="no node was found for pelvis, left_hip"):
        map_bones(table)
    with pytest.raises(InvalidArgument, match="its parent must stand before it"):
        Rig((Node("a", 0),))


NAMES = {  # hips, left thigh, shin, foot, toe, upper arm, forearm, hand
    "biped": "{} Pelvis;{} L Thigh;{} L Calf;{} L Foot;{} L Toe0;"
    "{} L UpperArm;{} L Forearm;{} L Hand".replace("{}", "Bip001"),
    "character_creator": "{}Hip;{}L_Thigh;{}L_Calf;{}L_Foot;{}L_ToeBase;"
    "{}L_Upperarm;{}L_Forearm;{}L_Hand".replace("{}", "CC_Base_"),
    "rigify": "{}pelvis;{}thigh.L;{}shin.L;{}foot.L;{}toe.L;"
    "{}upper_arm.L;{}forearm.L;{}hand.L".replace("{}", "DEF-"),
    "bvh": "Hips;LeftHip;LeftKnee;LeftAnkle;LeftToe;LeftShoulder;LeftElbow;LeftWrist",
    "vroid": "{}C_Hips;{}L_UpperLeg;{}L_LowerLeg;{}L_Foot;{}L_ToeBase;"
    "{}L_UpperArm;{}L_LowerArm;{}L_Hand".replace("{}", "J_Bip_"),
    "makehuman": "hips;upperleg01.L;lowerleg01.L;foot.L;toe1-1.L;upperarm01.L;lowerarm01.L;wrist.L",
}


@pytest.mark.parametrize("names", NAMES.values(), ids=NAMES)
def test_names_of_common_rigs(names):
    own = ("pelvis", "left_hip", "left_knee", "left_ankle", "left_foot")
    own += ("left_shoulder", "left_elbow", "left_wrist")
    table = dict(zip(own, names.split(";"), strict=True))
    mirror = str.maketrans({"L": "R"})
    for bone, name in list(table.items())[1:]:
        other = name.replace("Left", "Right") if "Left" in name else name
        if other == name:
            other = name.replace(".L", ".R").replace("_L_", "_R_").replace(" L ", " R ")
        assert other != name, mirror
        table[bone.replace("left", "right")] = other
    rig = Body(OFFSETS, names=lambda bone: table.get(bone, f"x{BONES.index(bone)}")).rig()
    found = map_bones(rig)
    assert found.found_by == "names"
    assert {bone: found.table()[bone] for bone in table} == table


@pytest.mark.parametrize("name", foreign_rigs())
def test_all_bones_of_rigs_that_others_made_are_found(name):
    """MakeHuman's own and Rigify's human."""
    found = RIGS[f"foreign {name}"]
    assert found.missing == () and found.found_by == "names"


def test_rotations():
    turn = arc(np.array([1.0, 0, 0]), np.array([0, 0, -2.0]))
    np.testing.assert_allclose(rotate(turn, np.array([1.0, 0, 0])), [0, 0, -1], atol=1e-12)
    opposite = arc(np.array([0, 1.0, 0]), np.array([0, -1.0, 0]))
    np.testing.assert_allclose(rotate(opposite, np.array([0, 1.0, 0])), [0, -1, 0], atol=1e-12)
    for q in (turn, multiply(turn, opposite), np.array([0.5, 0.5, -0.5, 0.5])):
        matrix = np.stack([rotate(q, axis) for axis in np.eye(3)], 1)
        assert abs(from_axes(matrix) @ q) == pytest.approx(1)
        np.testing.assert_allclose(multiply(q, inverse(q)), [0, 0, 0, 1], atol=1e-12)


def test_bases_are_those_of_the_server():
    from wayfarer.transport.conversion.basis import Basis

    for basis in Basis:
        axes, own = basis.axes, BASES[basis.value]
        np.testing.assert_array_equal(own.up, axes.up)
        np.testing.assert_array_equal(own.forward, axes.forward)
        np.testing.assert_array_equal(own.left, axes.matrix @ (-1.0, 0.0, 0.0))
        assert own.handed == axes.handedness
    assert offsets_of("female", []).shape == OFFSETS.shape
