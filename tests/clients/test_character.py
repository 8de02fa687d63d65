"""A user's own character: its GLB with an agent's motion in it, read back as a player does."""

from pathlib import Path

import numpy as np
import pytest

from tests.clients.test_retarget import FRAMES, GLTF, OFFSETS
from tests.golden.rigs import foreign_rigs
from tests.navigation.meshes.glb_files import glb
from tests.played import Played, parts
from wayfarer_client import Character, InvalidArgument, Retarget, map_bones
from wayfarer_client.rig import BONES

HIPS = np.array([hips for hips, _, _ in FRAMES])
TURNS = np.array([turns for _, turns, _ in FRAMES])
RIGS = {case.name: (case.rig, case.humanoid) for case in GLTF} | {
    f"foreign_{name}": (rig, None) for name, rig in foreign_rigs().items()
}


def document_of(rig, humanoid=None, vrm=1, shift=3) -> dict:
    """Its nodes; `shift` others stand before them, so that numbers differ."""
    nodes = [{"name": f"light {k}"} for k in range(shift)]
    for node in rig.nodes:
        place, turn, scale = (
            [float(v) for v in values] for values in (node.position, node.rotation, node.scale)
        )
        nodes.append({"name": node.name, "translation": place, "rotation": turn, "scale": scale})
    for k, node in enumerate(rig.nodes):
        if node.parent >= 0:
            nodes[shift + node.parent].setdefault("children", []).append(shift + k)
    tops = [shift + k for k, node in enumerate(rig.nodes) if node.parent < 0]
    found = {"asset": {"version": "2.0"}, "nodes": nodes, "scenes": [{"nodes": [0, *tops]}]}
    if humanoid:
        table = {bone: {"node": shift + k} for bone, k in humanoid.items()}
        rows = [{"bone": bone, **entry} for bone, entry in table.items()]
        found["extensions"] = (
            {"VRMC_vrm": {"humanoid": {"humanBones": table}}}
            if vrm == 1
            else {"VRM": {"humanoid": {"humanBones": rows}}}
        )
    return found


@pytest.mark.parametrize("name", RIGS)
def test_bones_are_where_retargeting_puts_them(name):
    rig, humanoid = RIGS[name]
    data = glb(document_of(rig, humanoid, vrm=0 if name == "vrm0" else 1))
    character = Character.read(data)
    assert character.bones.found_by == map_bones(rig, humanoid).found_by
    made = character.animate(HIPS[:12], TURNS[:12], OFFSETS, fps=30, title="walk")
    played = Played(*parts(made))
    document = played.document
    assert document["animations"][0]["name"] == "walk"
    retarget = Retarget(map_bones(rig, humanoid), OFFSETS)
    for frame in (0, 5, 11):
        pose = retarget.pose(HIPS[frame], TURNS[frame])
        found = {
            document["nodes"][k]["name"]: world[frame, :3, 3] for k, world in played.world.items()
        }
        # both in the character's own axes: distance of each bone from the hips
        hips = found[rig.nodes[retarget.nodes[0]].name]
        for bone, place in pose.places.items():
            own = found[rig.nodes[retarget.nodes[bone]].name]
            apart = np.linalg.norm(place - pose.places[0])
            assert np.linalg.norm(own - hips) == pytest.approx(apart, abs=1e-3), BONES[bone]


def test_the_rest_of_the_file_stays():
    rig, _ = RIGS["mixamo"]
    document = document_of(rig)
    binary = np.arange(6, dtype="<f4").tobytes()
    document |= {
        "buffers": [{"byteLength": 22}],  # two bytes of the chunk are padding
        "bufferViews": [{"buffer": 0, "byteLength": 20}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 5, "type": "SCALAR"}],
        "animations": [{"name": "idle", "channels": [], "samplers": []}],
        "materials": [{"name": "cloth"}],
    }
    made, data = parts(Character.read(glb(document, binary)).animate(HIPS[:3], TURNS[:3], OFFSETS))
    assert data[:22] == binary[:22]
    assert [animation["name"] for animation in made["animations"]] == ["motion", "idle"]
    for key in ("nodes", "scenes", "materials"):
        assert made[key] == document[key]
    assert made["accessors"][0] == document["accessors"][0]
    assert made["buffers"][0]["byteLength"] == len(data)
    for view in made["bufferViews"][1:]:
        assert view["byteOffset"] % 4 == 0 and view["byteOffset"] + view["byteLength"] <= len(data)


def test_a_matrix_becomes_what_can_be_animated():
    rig, _ = RIGS["mixamo"]
    document = document_of(rig)
    number = next(k for k, n in enumerate(document["nodes"]) if n["name"].endswith("LeftUpLeg"))
    node = document["nodes"][number]
    place = node.pop("translation")
    del node["rotation"], node["scale"]
    node["matrix"] = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *place, 1]
    made, _ = parts(Character.read(glb(document)).animate(HIPS[:2], TURNS[:2], OFFSETS))
    assert "matrix" not in made["nodes"][number]
    assert made["nodes"][number]["translation"] == pytest.approx(place)


def test_a_map_can_be_corrected():
    character = Character.read(glb(document_of(RIGS["mixamo"][0])))
    changed = character.corrected({"head": None})
    assert "head" in character.bones.bones and "head" not in changed.bones.bones


PLAIN = document_of(RIGS["mixamo"][0])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a GLB"),
        (b"Kaydara FBX Binary", "not a GLB"),
        (b"glTF\x02\0\0\0", "no JSON"),
        (glb(PLAIN)[:-40], "ends in the middle"),
        (glb([1]), "no object"),
        (glb({"nodes": [{"children": [0]}], "scenes": [{"nodes": [0]}]}), "hangs from"),
        (glb({"nodes": [{"children": [7]}], "scenes": [{"nodes": [0]}]}), "damaged"),
        (glb({"nodes": [{"translation": ["a", 0, 0]}], "scenes": [{"nodes": [0]}]}), "damaged"),
        (glb({"nodes": [{"translation": [1e999, 0, 0]}], "scenes": [{"nodes": [0]}]}), "damaged"),
        (glb({"nodes": 3}), "damaged"),
        (glb({"nodes": [{}] * 20_001}), "20001 nodes; allowed are 20,000"),
        (
            glb({"nodes": [{"name": "cube"}], "scenes": [{"nodes": [0]}]}),
            "no node was found for pelvis",
        ),
    ],
)
def test_what_is_no_character_is_refused(data, message):
    with pytest.raises(InvalidArgument, match=message):
        Character.read(data)


def test_data_in_another_file_is_refused():
    document = PLAIN | {"buffers": [{"byteLength": 4, "uri": "hero.bin"}]}
    with pytest.raises(InvalidArgument, match="in another file"):
        Character.read(glb(document)).animate(HIPS[:2], TURNS[:2], OFFSETS)
    with pytest.raises(InvalidArgument, match="0 frames"):
        Character.read(glb(PLAIN)).animate(HIPS[:0], TURNS[:0], OFFSETS)


def test_the_server_has_the_same_modules():
    own = Path(__file__).parents[2] / "service" / "wayfarer" / "characters"
    linked = {path.name for path in own.iterdir() if path.is_symlink()}
    assert {"character.py", "retarget.py", "bone_map.py", "bone_names.json"} <= linked
    from wayfarer.characters.character import Character as Served
    from wayfarer.errors import InvalidArgument as Refusal

    with pytest.raises(Refusal, match="not a GLB"):
        Served.read(b"")
