"""Bone names of files map by themselves in engines."""

import re

import pytest

from wayfarer.body.skeleton import bone_names, parents
from wayfarer.clips.files import BoneNames

SIDES = ("Left", "Right")
LIMBS = ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand")
UNITY = ("Hips", "Spine", "Head", *(f"{side}{bone}" for side in SIDES for bone in LIMBS))
"""HumanBodyBones that a Humanoid avatar needs: 15."""
GODOT = UNITY
"""Bones that SkeletonProfileHumanoid requires."""


class GodotMapper:
    """How Godot 4's BoneMapper guesses (editor/plugins/bone_map_editor_plugin.cpp): words in order
    of preference, the side, the shortest name; legs and arms upwards from foot and hand."""

    def __init__(self, names, above):
        self.names, self.above = names, above
        self.below = {k: [c for c, p in enumerate(above) if p == k] for k in range(-1, len(names))}

    def side(self, name):
        snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
        for full, short in (("left", "l"), ("right", "r")):
            if re.search(rf"(?<![a-z]){full}|(?<![a-z0-9]){short}(?![a-z0-9])", snake):
                return full
        return ""

    def find(self, words, side="", under=-1, over=None, fingers=0):
        if over is None:
            line = list(self.below[under])
            for k in line:
                line.extend(self.below[k])
            line = [k for k in line if len(self.below[k]) >= fingers]
        else:
            line, k = [], self.above[over]
            while k not in (under, -1):
                line.append(k)
                k = self.above[k]
        for word in words:
            hits = [k for k in line if re.search(word, self.names[k].lower())]
            hits = [k for k in hits if self.side(self.names[k]) == side]
            if hits:  # the parent of equally long ones
                hits = hits if over is None else hits[::-1]
                return min(hits, key=lambda k: len(self.names[k]))
        return None

    def run(self):
        hips = self.find(("hip", "pelvis", "waist", "torso", "spine"))
        found = {"Hips": hips}
        shoulders = []
        for side in SIDES:
            low = side.lower()
            foot = self.find(("foot", "ankle"), low, hips)
            shin = self.find(("(low|under).*leg", "knee", "shin", "calf", "leg"), low, hips, foot)
            thigh = self.find(("up.*leg", "thigh", "leg"), low, hips, shin)
            hand = self.find(("hand", "wrist", "palm", "fingers"), low, hips, fingers=5)
            shoulder = self.find(("shoulder", "clavicle", "collar"), low, hips)
            forearm = self.find(("(low|fore).*arm", "elbow", "arm"), low, shoulder, hand)
            arm = self.find(("up.*arm", "arm"), low, shoulder, forearm)
            toes = self.find(("toe", "ball"), low, foot)
            bones = ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder")
            chain = (thigh, shin, foot, toes, shoulder)
            found |= {f"{side}{bone}": k for bone, k in zip(bones, chain, strict=True)}
            arms = zip(("UpperArm", "LowerArm", "Hand"), (arm, forearm, hand), strict=True)
            found |= {f"{side}{bone}": k for bone, k in arms}
            shoulders.append(shoulder)
        neck = self.find(("neck", "head", "face"), "", hips)
        found |= {"Neck": neck, "Head": self.find(("head", "face"), "", neck)}
        chest, spine = self.above[neck], []
        k = self.above[chest]
        while k not in (hips, -1):
            spine.insert(0, k)
            k = self.above[k]
        found |= {"Spine": spine[0], "Chest": spine[-1], "UpperChest": chest}
        return {bone: k for bone, k in found.items() if k is not None}


@pytest.mark.parametrize("vocabulary", ["mixamo", "unity", "vrm", "ue"])
@pytest.mark.parametrize("root", [False, True])
def test_godot_maps_all_bones_by_their_names(vocabulary, root):
    names, above = list(bone_names(vocabulary)), list(parents())
    if root:
        names, above = ["root", *names], [-1, *(p + 1 for p in above)]
    found = GodotMapper(names, above).run()
    assert set(GODOT) <= set(found)
    right = dict(zip(bone_names("unity"), bone_names(vocabulary), strict=True))
    assert {bone: names[k] for bone, k in found.items()} == {bone: right[bone] for bone in found}
    assert len(found) == 22


def test_names_of_unity_are_human_body_bones():
    assert set(UNITY) <= set(bone_names("unity"))


WORDS = {
    "UpperLeg": "upleg|upperleg|thigh", "LowerLeg": "leg|calf|shin", "Foot": "foot|ankle",
    "UpperArm": "arm|upperarm", "LowerArm": "forearm|lowerarm", "Hand": "hand|wrist",
    "Hips": "hips|pelvis", "Spine": "spine", "Head": "head",
}  # fmt: skip


@pytest.mark.parametrize("vocabulary", ["mixamo", "unity", "vrm", "ue"])
def test_each_required_bone_has_a_word_and_side_that_unity_looks_for(vocabulary):
    """Unity's avatar mapping goes by words of the name and the side."""
    named = dict(zip(bone_names("unity"), bone_names(vocabulary), strict=True))
    for bone in UNITY:
        name = named[bone]
        side = "left" if bone.startswith("Left") else "right" if bone.startswith("Right") else ""
        words = WORDS[bone.removeprefix("Left").removeprefix("Right")]
        assert re.search(words, name.lower()), (bone, name)
        assert not side or re.search(rf"^{side}|_{side[0]}$", name.lower()), (bone, name)


def test_every_vocabulary_names_all_bones():
    for vocabulary in BoneNames:
        assert len(set(bone_names(vocabulary))) == 52
