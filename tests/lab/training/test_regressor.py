import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.regressor import BodyRegressor
from wayfarer_lab.training.cli import read_config
from wayfarer_lab.training.regressor import RegressorConfig, RegressorTrainer, train_regressor

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
    noisy, betas, markers, rotations = trainer.sample(trainer.frames, torch.arange(64), noise=0.02)
    heading = torch.atan2(rotations[:, 0, 1, 0], rotations[:, 0, 0, 0])  # of the hips' X axis
    assert heading.abs().max() <= SMALL.heading + 1e-5
    assert heading.std() > 0.2
    assert 0.002 < (noisy - markers).std() < 0.02
    assert betas.abs().max() <= 2.5


def test_gradients_flow_through_the_paper_s_recursions():
    """The same estimate either way, and another gradient; finite at the T-pose, where it begins."""
    body = marker_body(load_body("anny52", "male"))
    torch.manual_seed(0)
    resting = body.resting(torch.zeros(2, 10)).transpose(-1, -2)
    markers = resting[:, None] + 0.02 * torch.randn(67, 3)
    gradients, estimates = [], []
    for through in (True, False):
        torch.manual_seed(0)
        regressor = BodyRegressor(body, through=through)
        place, rotations = regressor(markers, torch.zeros(2, 10))
        (place.sum() + rotations.square().sum() + rotations[..., 0, 1].sum()).backward()
        estimates.append(rotations.detach())
        first = regressor.network[0].weight.grad
        assert first is not None and torch.isfinite(first).all()
        gradients.append(first)
    assert torch.equal(*estimates)
    assert not torch.allclose(*gradients)


def test_the_paper_s_regressor_learns_by_eq_2_alone(tmp_path):
    for gender in ("female", "male"):
        config = read_config(RegressorConfig, f"paper/regressor_{gender}")
        assert config.through and config.gender == gender
        assert config.rotation_weight == config.surface_weight == 0
    small = SMALL.model_copy(update={"steps": 2, "through": True})
    body = load_body("anny52", "female")
    assert train_regressor(small, gliding_frames(), gliding_frames(seed=1), body, tmp_path / "run")
