"""The program of MMCP over a real server, on our skeleton and on others."""

import base64
import re
import subprocess
import sys

import grpc
import httpx
import numpy as np
import pytest

from tests.clients.fake_server import Refusal
from tests.clients.test_retarget import GLTF
from tests.golden.rigs import foreign_rigs
from tests.played import Played

pytest.importorskip("motionmcp", reason="needs motionmcp-sdk")

from motionmcp import GenerateRequest
from motionmcp.errors import ProtocolError

from wayfarer_client.mmcp.prompts import orders
from wayfarer_client.mmcp.walker import Walker


@pytest.fixture(scope="module")
def url(real_server):
    command = [sys.executable, "-m", "wayfarer_client.mmcp", real_server.grpc_address]
    with subprocess.Popen([*command, "--port", "0"], stderr=subprocess.PIPE, text=True) as program:
        try:
            said = []
            for line in program.stderr:
                said.append(line)
                if found := re.search(r"http://127\.0\.0\.1:\d+", line):
                    break
            assert found, "".join(said)
            yield found[0]
        finally:
            program.terminate()


@pytest.fixture(scope="module")
def model(url):
    found = httpx.get(f"{url}/capabilities").json()
    assert found["coordinate_system"] == "right_handed_y_up"
    (model,) = found["models"]
    return model


def skeleton_of(rig) -> dict:
    return {
        "joints": [
            {
                "name": node.name,
                "parent": rig.nodes[node.parent].name if node.parent >= 0 else None,
                "rest_translation": [float(v) for v in node.position],
                "rest_rotation": [float(v) for v in node.rotation],
            }
            for node in rig.nodes
        ]
    }


def request(model, **more) -> dict:
    return {
        "protocol_version": "1.0",
        "model": model["id"],
        "skeleton": model["canonical_skeleton"],
        "timing": {"fps": 30},
    } | more


def text(prompt, frames=90):
    return [{"type": "text", "prompt": prompt, "duration_frames": frames}]


def test_it_says_what_it_can(model):
    assert model["supports_retargeting"] and model["supported_constraints"] == ["root_path"]
    assert len(model["canonical_skeleton"]["joints"]) == 22


def world(document, sample=0) -> tuple[list[str], np.ndarray]:
    """Names of the joints, and their places [N, J, 3]."""
    (buffer,) = document["buffers"]
    played = Played(document, base64.b64decode(buffer["uri"].partition(",")[2]), sample)
    joints = sorted(node for node, path in played.channels if path == "rotation")
    return [document["nodes"][k]["name"] for k in joints], played.places(joints)


def made(url, body) -> dict:
    answer = httpx.post(f"{url}/generate", json=body, timeout=60)
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_walk_in_words_on_our_skeleton(url, model):
    document = made(url, request(model, segments=text("walk forward 2 m", 120)))
    names, places = world(document)
    assert len(places) == 120
    hips = places[:, names.index("Hips")]
    assert np.hypot(*hips[0, [0, 2]]) < 0.2
    assert hips[-1, 2] == pytest.approx(2.0, abs=0.4) and abs(hips[-1, 0]) < 0.4
    feet = places[:, [names.index("LeftToeBase"), names.index("RightToeBase")], 1]
    assert 0.0 < feet.min(1).max() < 0.08  # one foot is on the floor, always


def test_a_walk_in_words_begins_where_the_character_stands(url, model):
    """MMCP's add-on for Blender pins the first frame, in addition to words and settings."""
    asked = request(model, segments=text("walk forward 2 m", 120))
    asked["segments"][0]["seed"] = 1  # of 200 people one ends .44 m off, and half of them .1 m
    asked["options"] = {
        "diffusion_steps": 50,
        "num_samples": 1,
        "seed": None,
        "post_processing": True,
        "transition_frames": 5,
        "guidance": {"type": "separated", "weight": [2.0, 2.0]},
    }
    asked["constraints"] = [{"type": "root_path", "frames": [0], "positions_xz": [[3, -1]]}]
    names, places = world(made(url, asked))
    hips = places[:, names.index("Hips")]
    np.testing.assert_allclose(hips[0, [0, 2]], [3, -1], atol=0.2)
    np.testing.assert_allclose(hips[-1, [0, 2]], [3, 1], atol=0.4)
    asked["constraints"][0]["heading_radians"] = [np.pi / 2]
    names, places = world(made(url, asked))
    np.testing.assert_allclose(places[-1, names.index("Hips")][[0, 2]], [5, -1], atol=0.4)


RIGS = {"a_pose": next(c.rig for c in GLTF if c.name == "a_pose")} | {
    name: foreign_rigs()[name] for name in ("game_engine", "rigify")
}


@pytest.mark.parametrize("name", RIGS)
def test_other_skeletons_are_retargeted(url, model, name):
    """Bones keep their length; the root, which may be above the hips, carries them along a path."""
    rig = RIGS[name]
    body = request(model, skeleton=skeleton_of(rig), duration_frames=120)  # it stands first
    body["constraints"] = [
        {"type": "root_path", "frames": [0, 60], "positions_xz": [[1, 1], [1, 3]]}
    ]
    names, places = world(made(url, body))
    assert names == [node.name for node in rig.nodes] and len(places) == 120
    parents = [node.parent for node in rig.nodes]
    for k, parent in enumerate(parents):
        if parent >= 0:
            length = np.linalg.norm(rig.places[k] - rig.places[parent])
            apart = np.linalg.norm(places[:, k] - places[:, parent], axis=-1)
            np.testing.assert_allclose(apart, length, atol=1e-4)
    hips = next(k for k, n in enumerate(rig.nodes) if n.name in ("Hips", "pelvis", "spine"))
    travelled = places[-1, hips] - places[0, hips]
    assert travelled[2] == pytest.approx(2.0, abs=0.5) and abs(travelled[0]) < 0.4


def test_samples_differ_and_seeds_repeat(url, model):
    options = {"num_samples": 2, "seed": 7}
    body = request(model, segments=text("walk, then stand", 60), options=options)
    document = made(url, body)
    assert len(document["animations"]) == 2
    first, second = (world(document, k)[1] for k in range(2))
    assert np.abs(first - second).max() > 1e-3
    np.testing.assert_array_equal(world(made(url, body))[1], first)


@pytest.mark.parametrize(
    ("change", "code", "message"),
    [
        ({"segments": text("dance wildly")}, "invalid_request", "walk"),
        ({"segments": text("walk", 9000)}, "invalid_options", "duration"),
        (
            {
                "skeleton": skeleton_of(GLTF[0].rig)
                | {"joints": skeleton_of(GLTF[0].rig)["joints"][:3]}
            },
            "invalid_skeleton",
            "no node was found",
        ),
        ({"timing": {"fps": 1000}}, "invalid_request", "1 to 240"),
        ({"model": "kimodo"}, "unknown_model", "kimodo"),
        ({"speed": 3}, "schema_validation", ""),
    ],
)
def test_the_rest_is_refused_in_the_envelope(url, model, change, code, message):
    body = request(model, segments=text("walk")) | change
    answer = httpx.post(f"{url}/generate", json=body)
    assert 400 <= answer.status_code < 500
    error = answer.json()["error"]
    assert error["code"] == code and message in error["message"]


def test_a_pose_is_no_constraint_of_ours(url, model):
    pose = {"type": "pose_keyframe", "frame": 0, "joint_rotations": {"Hips": [0, 0, 0, 1]}}
    body = request(model, segments=text("walk"), constraints=[pose])
    error = httpx.post(f"{url}/generate", json=body).json()["error"]
    assert error["code"] == "unsupported_constraint"


def test_no_page_with_scripts_from_elsewhere(url):
    for path in ("docs", "redoc", "openapi.json"):
        assert httpx.get(f"{url}/{path}").status_code == 404


@pytest.mark.parametrize(
    ("prompt", "count"),
    [
        ("walk", 1),
        ("Walk slowly  forward 3 m.", 1),
        ("walk left 2.5m, then stand", 2),
        ("walk briskly to -2, 1.5; stand still", 2),
        ("stand, walk backward", 2),
    ],
)
def test_the_grammar(prompt, count):
    assert len(orders(prompt)) == count


@pytest.mark.parametrize("prompt", ["", " . ", "run", "walk 3 miles", "walk to 3", "walk " * 300])
def test_what_the_grammar_does_not_have(prompt):
    with pytest.raises(ValueError, match=r"understood are: walk \[slowly"):
        orders(prompt)


async def test_who_may_only_read_gets_no_motion(server, client):
    def refused(_):
        raise Refusal(grpc.StatusCode.PERMISSION_DENIED, "scope control is needed")

    server.answers["FitBody"] = refused
    body = {"protocol_version": "1.0", "model": "wayfarer", "segments": text("walk")}
    asked = GenerateRequest.model_validate(body | {"skeleton": skeleton_of(GLTF[0].rig)})
    with pytest.raises(ProtocolError) as caught:
        await Walker(client, spec=None).generate(asked)
    assert (caught.value.code, caught.value.status_code) == ("forbidden", 403)
