"""Characters of any skeleton: rigs made from our own body (tests/golden/rigs.py)."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.golden.rigs import Body, cases, offsets_of
from wayfarer_client.bases import BASES
from wayfarer_client.bone_map import map_bones
from wayfarer_client.errors import InvalidArgument
from wayfarer_client.quaternions import IDENTITY, arc, from_axes, inverse, multiply, rotate
from wayfarer_client.retarget import LEGS, Retarget
from wayfarer_client.rig import BONES, PARENTS, Node, Rig

WALK_FILE = Path(__file__).parents[1] / "golden" / "walk.json"
WALK = json.loads(WALK_FILE.read_text())
OFFSETS = np.array(WALK["rest_offsets"]).reshape(-1, 3)
FRAMES = [
    (np.array(hips), np.array(turns).reshape(-1, 4), bits)
    for hips, turns, bits in zip(WALK["hips"], WALK["rotations"], WALK["contacts"], strict=True)
]
GLTF = [case for case in cases() if case.basis == "gltf"]
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
        pose = retarget.pose(hips, turns, ground=0.0)
        wanted = source_places(hips, turns)
        found = np.array([pose.places[bone] for bone in range(len(BONES))])
        assert np.abs(found - wanted).max() < 0.002


@each
def test_stance_feet_are_on_the_ground_and_stay_there(case):
    """Sole within 2 cm of the ground; a print moves at most 1 cm more than the agent's."""
    retarget = retarget_to(case)
    prints: dict[int, tuple] = {}
    for hips, turns, bits in FRAMES:
        pose = retarget.pose(hips, turns, ground=0.0)
        worlds, places = retarget._source_pose(hips, turns)
        for leg, bones in enumerate(LEGS):
            low, ball = retarget._lowest(retarget.foot[leg], worlds, bones)
            _, own_ball = retarget._lowest(retarget.source_foot[leg], worlds, bones)
            if not bits & 1 << leg:
                prints.pop(leg, None)
                continue
            assert abs(pose.places[bones[2]][1] + low) < 0.02
            at, own = pose.places[bones[2]] + ball, places[bones[2]] + own_ball
            first, own_first = prints.setdefault(leg, (at, own))
            slid = np.linalg.norm((at - first)[[0, 2]]) - np.linalg.norm((own - own_first)[[0, 2]])
            assert slid < (0.01 if retarget.ratio > 0.95 else 0.04)  # short legs do not reach all


@each
def test_hips_are_at_scaled_height_and_limbs_point_as_the_agents(case):
    retarget = retarget_to(case)
    for hips, turns, _ in FRAMES[::5]:
        pose = retarget.pose(hips, turns, ground=0.0)
        wanted = source_places(hips, turns)
        assert pose.places[0][1] == pytest.approx(retarget.ratio * hips[1], rel=1e-6)
        assert np.allclose(pose.places[0][[0, 2]], hips[[0, 2]])
        for above, below in ((16, 18), (18, 20), (17, 19), (19, 21)):
            limb = pose.places[below] - pose.places[above]
            agents = wanted[below] - wanted[above]
            cosine = limb @ agents / np.linalg.norm(limb) / np.linalg.norm(agents)
            assert np.degrees(np.arccos(min(1, cosine))) < 1


@each
def test_local_rotations_give_the_same_places_through_the_files_own_nodes(case):
    """What an engine computes from local rotations, twist bones and scales included."""
    bones = map_bones(case.rig, case.humanoid)
    pose = Retarget(bones, OFFSETS).pose(*FRAMES[20][:2])
    nodes = list(case.rig.nodes)
    for bone, node in bones.bones.items():
        number = BONES.index(bone)
        position = pose.hips if number == 0 else nodes[node].position
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
    with pytest.raises(InvalidArgument, match="lacks left_knee"):
        bones.corrected({"left_knee": None})
    with pytest.raises(InvalidArgument, match="left_knee: 'head' does not hang from the hip"):
        bones.corrected({"left_knee": "head"})
    with pytest.raises(InvalidArgument, match="hangs from"):
        bones.corrected({"spine3": "head", "head": "spine3"})


def test_what_is_no_humanoid_is_refused_in_words():
    table = Rig((Node("table", -1), Node("leg1", 0, (0, -1, 0)), Node("leg2", 0, (1, -1, 0))))
    with pytest.raises(InvalidArgument, match="neither the names nor the shape"):
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


FOREIGN = json.loads(WALK_FILE.with_name("foreign_rigs.json").read_text())["rigs"]


def foreign(bones) -> Rig:
    """As Blender exports it: its Z up turned to glTF's axes, each bone's y along it."""
    half = np.sqrt(0.5)
    nodes, worlds = [Node("Armature", -1, rotation=(-half, 0, 0, half))], [IDENTITY]
    for name, parent, head, tail in bones:
        along = np.subtract(tail, head)
        world = arc(np.array([0, 1.0, 0]), along) if along.any() else IDENTITY
        above, at = (worlds[parent + 1], bones[parent][2]) if parent >= 0 else (IDENTITY, (0, 0, 0))
        place = rotate(inverse(above), np.subtract(head, at))
        nodes.append(Node(name, parent + 1, place, multiply(inverse(above), world)))
        worlds.append(world)
    return Rig(tuple(nodes))


@pytest.mark.parametrize("bones", FOREIGN.values(), ids=FOREIGN)
def test_rigs_that_others_made(bones):
    """MakeHuman's own and Rigify's human: no bone is missing, stance feet within 2 cm."""
    bone_map = map_bones(foreign(bones))
    assert bone_map.missing == () and bone_map.found_by == "names"
    retarget = Retarget(bone_map, OFFSETS)
    for hips, turns, bits in FRAMES:
        pose = retarget.pose(hips, turns, ground=0.0)
        worlds, _ = retarget._source_pose(hips, turns)
        assert pose.places[0][1] == pytest.approx(retarget.ratio * hips[1], rel=1e-6)
        for leg, chain in enumerate(LEGS):
            if bits & 1 << leg:
                low, _ = retarget._lowest(retarget.foot[leg], worlds, chain)
                assert abs(pose.places[chain[2]][1] + low) < 0.02


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
    from wayfarer.transport.basis import Basis

    for basis in Basis:
        axes, own = basis.axes, BASES[basis.value]
        np.testing.assert_array_equal(own.up, axes.up)
        np.testing.assert_array_equal(own.forward, axes.forward)
        np.testing.assert_array_equal(own.left, axes.matrix @ (-1.0, 0.0, 0.0))
        assert own.handed == axes.handedness
    assert offsets_of("female", []).shape == OFFSETS.shape
