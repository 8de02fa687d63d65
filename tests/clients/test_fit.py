"""An agent made with a character's proportions: its walk fits the character's legs."""

import numpy as np
import pytest

import wayfarer_client as wf
from tests.clients.rig_errors import Errors, Walk, errors
from tests.clients.test_retarget import GLTF
from tests.golden.rigs import foreign_rigs
from wayfarer_client.bone_map import map_bones
from wayfarer_client.joints import character_joints
from wayfarer_client.retarget import Retarget
from wayfarer_client.rig import BONES

MAPS = {case.name: map_bones(case.rig, case.humanoid) for case in GLTF} | {
    name: map_bones(rig) for name, rig in foreign_rigs().items()
}
WALKED = ("a_pose", "missing_chest", "vrm1", "rigify")
MEAN = wf.AgentSpec(seed=3)


@pytest.fixture(scope="module")
def client(real_server):
    with wf.SyncClient(real_server.grpc_address) as connected:
        yield connected


def track_of(client, spec: wf.AgentSpec) -> wf.Track:
    goals = [wf.Goal((1.5, 0, 2)), wf.Goal((-1, 0, 3))]
    (track,) = wf.tracks(client.generate_clip(spec, goals, 5.0)).values()
    return track


def walked(bone_map, track: wf.Track) -> Errors:
    offsets = np.array(track.agent.rest_offsets, float)[: len(BONES)]
    turns = np.array(track.rotations, float)
    hips = np.array(track.translation, float)
    return errors(Retarget(bone_map, offsets), Walk(offsets, hips, turns, track.contacts))


@pytest.mark.parametrize("name", WALKED)
def test_the_fitted_agent_walks_on_the_characters_feet(client, name):
    fit = client.fit_body(MAPS[name])
    assert fit.scale == 1.0
    assert max(abs(fit.errors_cm[bone]) for bone in ("thigh", "shin")) < 0.5, fit.errors_cm
    found = walked(MAPS[name], track_of(client, fit.spec(seed=3)))
    assert found.foot_height < 0.01 and found.hips < 0.02 and found.slide < 0.01


def test_short_legs_reach_further_than_with_the_mean_body(client):
    fit = client.fit_body(MAPS["vrm1"])
    fitted = walked(MAPS["vrm1"], track_of(client, fit.spec(seed=3)))
    mean = walked(MAPS["vrm1"], track_of(client, MEAN))
    assert 10 * fitted.hips < mean.hips and fitted.legs < mean.legs


@pytest.mark.parametrize("basis", ["unity", "unreal", "blender"])
def test_places_in_any_basis_give_the_same_body(client, basis):
    joints, floor = character_joints(MAPS["a_pose"])
    wanted = client.fit_body(joints, floor=floor)
    own = wf.BASES[basis]
    unit = 0.01 if basis == "unreal" else 1.0
    axes = np.stack([own.left, own.up, own.forward], 1) / unit  # of left, up, forward
    found = client.fit_body(
        {bone: axes @ place for bone, place in joints.items()}, floor=floor / unit, basis=basis
    )
    assert found.betas == pytest.approx(wanted.betas, abs=1e-4)


def test_what_is_wrong_is_named(client):
    joints, _ = character_joints(MAPS["a_pose"])
    with pytest.raises(wf.InvalidArgument, match="left_knee missing"):
        client.fit_body({bone: place for bone, place in joints.items() if bone != "left_knee"})
    with pytest.raises(wf.InvalidArgument, match="is the unit right"):
        client.fit_body({bone: 1000 * place for bone, place in joints.items()})
    with pytest.raises(wf.InvalidArgument, match="over the floor"):
        client.fit_body(joints, floor=1.2)
    with pytest.raises(wf.InvalidArgument, match="none of female, male"):
        client.fit_body(joints, gender="none")
    assert set(joints) <= set(BONES)


def test_over_http(real_server):
    import httpx

    joints, floor = character_joints(MAPS["mixamo"])
    body = {
        "joints": [
            {"bone": bone, "position": dict(zip("xyz", map(float, place), strict=True))}
            for bone, place in joints.items()
        ],
        "floor": floor,
    }
    made = httpx.post(f"{real_server.url}/v1/bodies:fit", json=body).json()
    with wf.SyncClient(real_server.grpc_address) as client:
        assert tuple(made["betas"]) == pytest.approx(client.fit_body(MAPS["mixamo"]).betas)
    twice = {**body, "joints": [*body["joints"][:21], body["joints"][0]]}
    refused = httpx.post(f"{real_server.url}/v1/bodies:fit", json=twice)
    assert (refused.status_code, refused.json()["errors"][0]["field"]) == (422, "joints[21].bone")
