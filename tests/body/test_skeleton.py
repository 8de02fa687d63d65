"""The bone table: its order, its vocabularies, and how a broken one is refused."""

import json

import pytest

from wayfarer.body import skeleton
from wayfarer.errors import ArtifactError
from wayfarer.spec import JOINTS, POSED_JOINTS


@pytest.fixture
def document():
    return json.loads(skeleton.SKELETON_FILE.read_text())


def written(tmp_path, document):
    path = tmp_path / "skeleton.json"
    path.write_text(json.dumps(document))
    return path


def test_fifty_two_bones_with_the_body_before_the_fingers():
    names = skeleton.joint_names()
    assert len(names) == JOINTS
    fingers = ("index", "middle", "pinky", "ring", "thumb")
    assert [any(f in n for f in fingers) for n in names] == [False] * POSED_JOINTS + [True] * 30
    assert names[POSED_JOINTS] == "left_index1" and names[-1] == "right_thumb3"


def test_parents_come_before_children():
    assert all(parent < j for j, parent in enumerate(skeleton.parents()))
    assert skeleton.parents().count(-1) == 1


def test_sides_mirror_in_every_vocabulary():
    bones = {bone.name: bone for bone in skeleton.load_skeleton()}
    for bone in bones.values():
        other = bones[skeleton.mirrored(bone.name)]
        assert skeleton.mirrored(other.name) == bone.name
        if bone.name.startswith("left_"):
            assert other.mixamo == bone.mixamo.replace("Left", "Right")
            assert other.unity == bone.unity.replace("Left", "Right")
            assert other.vrm == bone.vrm.replace("left", "right")
            assert other.ue == bone.ue.removesuffix("_l") + "_r"


def test_the_thumb_differs_between_unity_and_vrm():
    thumb = {b.name: b for b in skeleton.load_skeleton()}["left_thumb1"]
    assert (thumb.unity, thumb.vrm) == ("LeftThumbProximal", "leftThumbMetacarpal")


def test_unity_has_its_fifteen_required_bones():
    limbs = ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand")
    required = {"Hips", "Spine", "Head", *(s + limb for s in ("Left", "Right") for limb in limbs)}
    assert required <= {bone.unity for bone in skeleton.load_skeleton()}


def swap_two(document):
    document["bones"][4], document["bones"][1] = document["bones"][1], document["bones"][4]


def two_of_a_name(document):
    document["bones"][3]["vrm"] = "hips"


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda d: d.update(schema=2), "schema 1"),
        (lambda d: d["bones"].pop(), "a list of 52"),
        (lambda d: d["bones"][7].pop("ue"), r"bones\[7\]"),
        (lambda d: d["bones"][7].update(ue=3), r"bones\[7\].ue"),
        (swap_two, "must stand before it"),
        (lambda d: d["bones"][1].update(parent=None), "only the first bone"),
        (two_of_a_name, "more than once"),
    ],
)
def test_a_broken_table_is_refused(tmp_path, document, damage, message):
    damage(document)
    with pytest.raises(ArtifactError, match=message):
        skeleton.load_skeleton(written(tmp_path, document))


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(ArtifactError, match=r"nowhere\.json"):
        skeleton.load_skeleton(tmp_path / "nowhere.json")
