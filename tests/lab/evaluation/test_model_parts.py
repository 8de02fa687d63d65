"""Parts of a model folder and of training runs, joined to a step."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.errors import ArtifactError
from wayfarer.models.bundle import DEFAULT_MODEL
from wayfarer.motion.policy import GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.regressor import BodyRegressor
from wayfarer_lab.evaluation.model_parts import (
    OnnxPolicy,
    OnnxPosePrior,
    OnnxPredictor,
    Parts,
    Variant,
    load_parts,
)
from wayfarer_lab.training.graphs import (
    ExportGraph,
    body_inputs,
    policy_graph,
    predictor_graph,
    step_inputs,
)
from wayfarer_lab.training.pose_graphs import pose_decoder_graph, pose_encoder_graph
from wayfarer_lab.training.pose_networks import PosePrior
from wayfarer_lab.training.representation import REPRESENTATIONS, Name
from wayfarer_lab.training.rotation import matrix_from_rotvec


@pytest.fixture(scope="module")
def shipped():
    return load_parts(DEFAULT_MODEL, threads=1)


def run_folder(
    runs: Path, name: str, floor_origin: bool = True, representation: Name = "markers"
) -> MarkerPredictor:
    """A run as `wayfarer train` leaves it, of an untrained network."""
    folder = runs / name
    folder.mkdir(parents=True)
    model = MarkerPredictor(2, REPRESENTATIONS[representation].size)
    torch.save({"model": model.state_dict()}, folder / "last.pt")
    config = {
        "seed_frames": 2, "floor_origin": floor_origin, "representation": representation
    }  # fmt: skip
    (folder / "config.json").write_text(json.dumps(config))
    return model


class TorchSession:
    """Runs a step that could be exported as a graph, by the names of its inputs."""

    def __init__(self, graph: ExportGraph) -> None:
        self.graph = graph

    def run(self, outputs: list[str], given: dict[str, np.ndarray]) -> list[np.ndarray]:
        assert set(given) == set(self.graph.inputs) and outputs == list(self.graph.outputs)
        tensors = [torch.from_numpy(given[name]) for name in self.graph.inputs]
        made = self.graph.module(*tensors)
        return [part.numpy() for part in (made if isinstance(made, tuple) else (made,))]


def test_exported_parts_join_to_the_step_of_the_modules_themselves() -> None:
    torch.manual_seed(0)
    predictor, policy = MarkerPredictor(2), GoalPolicy()
    torch.nn.init.normal_(policy.output.weight, std=0.1)  # else it is the prior
    regressor = BodyRegressor(load_marker_bodies()["female"])
    modules = Parts({"ro-2f": predictor}, {"female": regressor}, policy, None, True)
    exported = Parts(
        {"ro-2f": OnnxPredictor(TorchSession(predictor_graph(predictor)), 2)},
        {"female": regressor},
        OnnxPolicy(TorchSession(policy_graph(policy))),
        None,
        True,
    )
    variant = Variant("x", "ro-2f", policy=True)
    steps = [parts.step("female", variant) for parts in (modules, exported)]
    generator = torch.Generator().manual_seed(3)
    given = step_inputs(5, 3, generator) | body_inputs(steps[0], 5, generator)
    with torch.inference_mode():
        expected, made = (step(**given) for step in steps)
    for name, theirs, ours in zip(made._fields, expected, made, strict=True):
        assert torch.allclose(ours, theirs, atol=1e-4), name


def test_an_exported_pose_prior_codes_as_the_module() -> None:
    torch.manual_seed(0)
    prior = PosePrior()
    turns = matrix_from_rotvec(0.3 * torch.randn(5, 21, 3))
    with torch.inference_mode():
        expected = prior.encode(turns)
        graphs = (pose_encoder_graph(prior), pose_decoder_graph(prior))
        exported = OnnxPosePrior(*(TorchSession(graph) for graph in graphs))
        made, latent = exported.encode(turns), torch.randn(5, 32)
        decoded, wanted = exported.decode(latent), prior.decode(latent)
    assert torch.allclose(made.mean, expected.mean, atol=1e-6)
    assert torch.allclose(decoded, wanted, atol=1e-6)


def test_a_variant_sets_blend_and_grounding(shipped) -> None:
    step = shipped.step("male", Variant("x", "ro-1f", blend=0.0, grounding=0.25))
    assert (step.blend, step.grounding, step.policy) == (0.0, 0.25, None)


def test_parts_take_many_latents_of_one_seed(shipped) -> None:
    seed, latents = torch.randn(3, 1, 201), torch.randn(3, 4, 128)
    together = shipped.predictors["ro-1f"].decode(seed, latents)
    assert together.shape == (3, 4, 9, 201)
    alone = shipped.predictors["ro-1f"].decode(seed[1:2], latents[1:2, 2:3])
    assert torch.allclose(together[1:2, 2:3], alone, atol=1e-5)


def test_runs_take_the_place_of_what_ships(shipped, tmp_path: Path) -> None:
    base = run_folder(tmp_path, "predictor_2f")
    again = run_folder(tmp_path, "predictor_2f_rollout")
    parts = load_parts(DEFAULT_MODEL, tmp_path, threads=1)
    assert list(parts.predictors) == ["2f", "ro-1f", "ro-2f"], "in the order of the paper"
    for name, model in (("2f", base), ("ro-2f", again)):
        weights = parts.predictors[name].state_dict()
        assert all(torch.equal(value, weights[key]) for key, value in model.state_dict().items())
    assert not hasattr(parts.predictors["ro-1f"], "decoder"), "still the exported graph"


def test_runs_may_hold_predictors_of_body_parameters(shipped, tmp_path: Path) -> None:
    run_folder(tmp_path, "direct_humor_rollout", representation="humor")
    parts = load_parts(DEFAULT_MODEL, tmp_path, threads=1)
    assert list(parts.direct) == ["ro-direct-humor"] and not shipped.direct
    assert parts.direct["ro-direct-humor"].predictor.size == 273
    assert list(parts.predictors) == ["ro-1f", "ro-2f"]
    run_folder(tmp_path, "direct_body", representation="markers")
    with pytest.raises(ArtifactError, match="direct_body: its frames are markers"):
        load_parts(DEFAULT_MODEL, tmp_path, threads=1)


def test_runs_without_a_checkpoint_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArtifactError, match=r"no checkpoint .*predictor_2f_rollout"):
        load_parts(DEFAULT_MODEL, tmp_path, threads=1)


def test_predictors_of_two_frames_of_reference_are_not_compared(tmp_path: Path) -> None:
    run_folder(tmp_path, "predictor_2f")
    run_folder(tmp_path, "predictor_2f_rollout", floor_origin=False)
    with pytest.raises(ArtifactError, match="floor_origin"):
        load_parts(DEFAULT_MODEL, tmp_path, threads=1)
