"""Copies of other sizes come to answer as their teachers do, and resume."""

import pytest
import torch

from wayfarer.errors import InvalidArgument
from wayfarer.motion.policy import GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.spec import LATENT, NEW_FRAMES
from wayfarer.terms import TERMS
from wayfarer_lab.training.distillation import (
    DistilledPolicyConfig,
    DistilledPredictorConfig,
    PolicyDistillation,
    PredictorDistillation,
    begin_as,
    distil_policy,
    distil_predictor,
)
from wayfarer_lab.training.run import TrainingRun, load_policy, load_predictor
from wayfarer_lab.training.visited import FILES, Visited


def questions(count: int, seed: int) -> Visited:
    generator = torch.Generator().manual_seed(seed)

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(count, *shape, generator=generator)

    body = 0.3 * torch.randn(201, generator=torch.Generator().manual_seed(9))
    return Visited(
        seed=body + 0.05 * normal(2, 201),
        goal=3 * normal(3),
        target_speed=normal().abs(),
        facing=normal(2),
        term_weights=normal(len(TERMS)).abs(),
        share=torch.ones(count),
        manner=normal(LATENT),
    )


@pytest.fixture
def teachers(tmp_path):
    torch.manual_seed(0)
    policy = GoalPolicy()
    torch.nn.init.normal_(policy.output.weight, std=0.1)
    for name, network in {"predictor": MarkerPredictor(2), "policy": policy}.items():
        (tmp_path / name).mkdir()
        torch.save({"model": network.state_dict()}, tmp_path / name / "last.pt")
        (tmp_path / name / "config.json").write_text('{"floor_origin": true}')
    return {name: str(tmp_path / name) for name in ("predictor", "policy")}


def learnt(trainer, folder, config, steps):
    """Validation before and after some updates."""
    trainer.run = TrainingRun(folder, config, trainer.model, trainer.optimizer)
    before = trainer.validate()
    for _ in range(steps):
        trainer.update()
        trainer.run.step += 1
    return before, trainer.validate()


def test_a_predictor_learns_to_find_all_frames_at_once(teachers, tmp_path):
    config = DistilledPredictorConfig(**teachers, steps=60, batch=128)
    trainer = PredictorDistillation(config, questions(400, 0), questions(64, 1))
    before, after = learnt(trainer, tmp_path / "run", config, 60)
    assert after["val/markers_mm"] < before["val/markers_mm"] / 2


def test_a_narrow_policy_learns_its_teachers_latents(teachers, tmp_path):
    config = DistilledPolicyConfig(**teachers, steps=80, batch=128, hidden=64)
    trainer = PolicyDistillation(config, questions(400, 0), questions(64, 1))
    before, after = learnt(trainer, tmp_path / "run", config, 80)
    assert after["val/mean"] < before["val/mean"]
    assert after["val/markers_mm"] < before["val/markers_mm"]


def test_a_copy_begins_with_what_its_teacher_knows():
    torch.manual_seed(0)
    teacher, seed, latent = MarkerPredictor(2), torch.randn(3, 2, 201), torch.randn(3, 1, LATENT)
    expected = teacher.decode(seed, latent)
    same, ahead = MarkerPredictor(2), MarkerPredictor(2, at_once=NEW_FRAMES)
    begin_as(same, teacher)
    assert torch.equal(same.decode(seed, latent), expected)
    begin_as(ahead, teacher)
    found = ahead.decode(seed, latent)
    first = seed[:, -1] + (expected[:, 0, 0] - seed[:, -1])
    assert torch.allclose(found[:, 0, 0], first, atol=1e-5)
    change = torch.diff(found[:, 0], dim=1)
    assert torch.allclose(change, change[:, :1].expand_as(change), atol=1e-5)  # straight on


def test_a_teacher_of_another_frame_is_refused(teachers):
    config = DistilledPredictorConfig(**teachers, floor_origin=False)
    with pytest.raises(InvalidArgument, match="floor_origin True"):
        PredictorDistillation(config, questions(8, 0), questions(8, 1))


def test_a_start_of_another_size_is_refused(teachers):
    predictor = DistilledPredictorConfig(**teachers, start_from=teachers["predictor"])
    with pytest.raises(InvalidArgument, match="finds 1 frames at once"):
        PredictorDistillation(predictor, questions(8, 0), questions(8, 1))
    policy = DistilledPolicyConfig(**teachers, start_from=teachers["policy"])
    with pytest.raises(InvalidArgument, match="is 512 wide"):
        PolicyDistillation(policy, questions(8, 0), questions(8, 1))


def test_both_are_written_as_runs_and_resume(teachers, tmp_path):
    (tmp_path / "asked").mkdir()
    for seed, file in enumerate(FILES):
        questions(64, seed).save(tmp_path / "asked" / file)
    predictor = DistilledPredictorConfig(**teachers, steps=2, batch=8)
    policy = DistilledPolicyConfig(**teachers, steps=2, batch=8)
    for config, distil in ((predictor, distil_predictor), (policy, distil_policy)):
        out = tmp_path / type(config).__name__
        assert not distil(config, tmp_path / "asked", out, minutes=0)
        assert distil(config, tmp_path / "asked", out)
    found = load_predictor(tmp_path / "DistilledPredictorConfig", 2)
    assert found.at_once == NEW_FRAMES
    assert load_policy(tmp_path / "DistilledPolicyConfig").condition.out_features == policy.hidden
