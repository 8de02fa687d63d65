import torch

from tests.lab.training.fakes import gliding_frames
from wayfarer.body.library import load_body
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
