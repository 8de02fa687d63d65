"""The imported networks inside our recursion, and the body with MOJO's markers under it."""

import json

import pytest
import torch

from tests.lab.gamma import release
from tests.lab.gamma.files import SSM2, write_body, write_checkpoints
from wayfarer.body.library import SMPLX_FOLDER, load_body
from wayfarer.errors import ArtifactError
from wayfarer.motion.frame import to_local
from wayfarer.motion.policy import Condition
from wayfarer_lab.gamma.models import gamma_graphs, ssm2_sites
from wayfarer_lab.training.graphs import step_inputs


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("gamma")
    write_body(made)
    return made


@pytest.fixture(scope="module")
def graphs(folder):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(SMPLX_FOLDER, str(folder))
        return gamma_graphs(write_checkpoints(folder))


def test_every_network_is_there_for_both_genders(graphs) -> None:
    genders = [
        f"{kind}_{gender}" for kind in ("regressor", "step") for gender in ("male", "female")
    ]
    assert {*graphs} == {f"{n}.onnx" for n in ("predictor_1f", "predictor_2f", "policy", *genders)}


def test_the_step_is_the_papers_recursion(graphs, folder) -> None:
    """Policy → latent → markers, in the frame at the hips, as its own networks give them."""
    step = graphs["step_male.onnx"].module
    given = step_inputs(2, 1, torch.Generator().manual_seed(0))
    given["policy"], given["noise"] = torch.ones(2), torch.zeros(2, 1, 128)
    frame, _ = step._begin(given["seed_translation"], given["seed_rotations"])
    assert not step.floor_origin
    torch.testing.assert_close(frame.origin, given["seed_translation"][:, 0])
    seed = to_local(frame, given["seed_markers"].flatten(1, 2)).unflatten(1, (2, 67))
    goal = to_local(frame, given["goal"][:, None])[:, 0]
    told = (given[name] for name in ("target_speed", "facing", "term_weights", "manner"))
    asked = Condition(goal, *told)
    found = step.predict(seed.flatten(2), asked, given["noise"], given["policy"])[:, 0]

    policy, predictor = release.Policy(), release.Predictor()
    for model, name in ((policy, "policy"), (predictor, "predictor_2f")):
        state = torch.load(folder / f"{name}.ckp", weights_only=True)["model_state_dict"]
        model.load_state_dict({k: v.half().float() for k, v in state.items()})  # as they ship
    ways = torch.nn.functional.normalize(goal[:, None, None] - seed, dim=-1)
    with torch.no_grad():
        mean, _ = policy(torch.cat([seed.flatten(2), ways.flatten(2)], -1).transpose(0, 1))
        expected = predictor.decode(seed.flatten(2).transpose(0, 1), mean, 8).transpose(0, 1)
        result = step(**given)
    torch.testing.assert_close(found, expected, atol=2e-5, rtol=1e-5)
    assert all(torch.isfinite(values).all() for values in result)


def test_markers_keep_the_files_order(folder, monkeypatch) -> None:
    monkeypatch.setenv(SMPLX_FOLDER, str(folder))
    body = load_body("smplx", "male")
    indices = json.loads((folder / "markers.json").read_text())["markersets"][0]["indices"]
    assert body.marker_names == tuple(SSM2)
    assert body.marker_vertices.tolist() == [indices[name] for name in SSM2]


def test_other_markers_are_refused_with_the_file_that_is_needed() -> None:
    with pytest.raises(ArtifactError, match=r"SSM2\.json; copy that file as markers\.json"):
        ssm2_sites(["C7", "CLAV"])
