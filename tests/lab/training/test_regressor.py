import pytest
import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import ArtifactError
from wayfarer.motion.regressor import BodyRegressor
from wayfarer_lab.training.cli import read_config
from wayfarer_lab.training.regressor import (
    LIMBS,
    RegressorConfig,
    RegressorTrainer,
    load_regressor,
    train_regressor,
    windows,
)
from wayfarer_lab.training.rotation import matrix_from_rotvec

SMALL = RegressorConfig(gender="female", steps=60, batch=64, rate=5e-4)


def test_a_short_training_learns_to_find_the_body(tmp_path):
    """One pose, many shapes and headings: the error falls well below the untrained one."""
    body = load_body("anny52", "female")
    train, held = gliding_frames(), gliding_frames(seed=1)
    before = RegressorTrainer(SMALL, train, held, body).validate()["val/marker_mm"]
    assert train_regressor(SMALL, train, held, body, tmp_path / "run")
    last = (tmp_path / "run" / "log.txt").read_text().splitlines()[-1]
    after = float(last.split("val/marker_mm")[1].split()[0])
    assert after < 0.5 * before


def test_samples_face_within_the_heading_spread_and_are_noisy_as_told():
    body = load_body("anny52", "female")
    trainer = RegressorTrainer(SMALL, gliding_frames(), gliding_frames(seed=1), body)
    sample = trainer.sample(windows(trainer.frames, torch.arange(64)), noise=0.02)
    first = sample.truth[:, 0, 0]
    heading = torch.atan2(first[:, 1, 0], first[:, 0, 0])  # of the hips' X axis
    assert heading.abs().max() <= SMALL.heading + 1e-5
    assert heading.std() > 0.2
    assert 0.002 < (sample.noisy - sample.markers).std() < 0.02
    assert sample.betas.abs().max() <= 2.5


def test_poses_are_mixed_and_bent_alike_in_all_frames():
    frames = gliding_frames()
    poses = windows(frames, torch.arange(64))
    poses = matrix_from_rotvec(torch.randn(64, 1, 22, 3)) @ poses  # each its own
    body = load_body("anny52", "female")

    def varied(**settings):
        config = SMALL.model_copy(update=settings)
        return RegressorTrainer(config, frames, frames, body).varied(poses)

    assert torch.equal(varied(varied=0.0), poses)
    mixed = varied(varied=1.0, exchanged=1.0, bent=0.0)
    for limb in LIMBS:
        pairs = (mixed[:, None, :, limb] - poses[None, :, :, limb]).abs().amax((2, 3, 4, 5))
        assert (pairs.amin(1) < 1e-6).all(), "a limb is that of one window"
        assert (pairs.argmin(1) != torch.arange(64)).float().mean() > 0.9
    assert torch.allclose(mixed[:, :, 0], poses[:, :, 0])
    bent = poses.transpose(-1, -2) @ varied(varied=1.0, exchanged=0.0, bent=0.2)
    assert torch.allclose(bent, bent[:, :1].expand_as(bent), atol=1e-5)
    angle = torch.rad2deg((((bent.diagonal(dim1=-2, dim2=-1).sum(-1)) - 1) / 2).clamp(-1, 1).acos())
    assert 5 < angle.mean() < 20


def test_a_run_says_how_many_networks_it_has(tmp_path):
    body = load_body("anny52", "female")
    for networks in (1, 2):
        config = SMALL.model_copy(update={"steps": 1, "networks": networks})
        folder = tmp_path / str(networks)
        assert train_regressor(config, gliding_frames(), gliding_frames(seed=1), body, folder)
        assert len(load_regressor(marker_body(body), folder).networks) == networks
    old = {"model": {"network.0.weight": torch.zeros(1)}}
    torch.save(old, folder / "last.pt")
    with pytest.raises(ArtifactError, match="older version"):
        load_regressor(marker_body(body), folder)


def test_gradients_flow_through_the_paper_s_recursions():
    """The same estimate either way, and another gradient; finite at the T-pose, where it begins."""
    body = marker_body(load_body("anny52", "male"))
    torch.manual_seed(0)
    resting = body.resting(torch.zeros(2, 10)).transpose(-1, -2)
    markers = resting[:, None] + 0.02 * torch.randn(67, 3)
    gradients, estimates = [], []
    for through in (True, False):
        torch.manual_seed(0)
        regressor = BodyRegressor(body, networks=1, through=through)
        place, rotations = regressor(markers, torch.zeros(2, 10))
        (place.sum() + rotations.square().sum() + rotations[..., 0, 1].sum()).backward()
        estimates.append(rotations.detach())
        first = regressor.networks[0][0].weight.grad
        assert first is not None and torch.isfinite(first).all()
        gradients.append(first)
    assert torch.equal(*estimates)
    assert not torch.allclose(*gradients)


def test_the_paper_s_regressor_learns_by_eq_2_alone(tmp_path):
    for gender in ("female", "male"):
        config = read_config(RegressorConfig, f"paper/regressor_{gender}")
        assert config.through and config.networks == 1 and config.gender == gender
        assert config.rotation_weight == config.surface_weight == 0
    small = SMALL.model_copy(update={"steps": 2, "networks": 1, "through": True})
    body = load_body("anny52", "female")
    assert train_regressor(small, gliding_frames(), gliding_frames(seed=1), body, tmp_path / "run")
