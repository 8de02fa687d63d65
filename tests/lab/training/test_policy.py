import pytest
import torch

from tests.lab.training.walkers import environment
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer_lab.training.cli import CONFIGS, read_config
from wayfarer_lab.training.policy import (
    PolicyConfig,
    PolicyTrainer,
    load_steps,
    reward_weights,
    train_policy,
)
from wayfarer_lab.training.ppo import PpoSettings
from wayfarer_lab.training.predictor import PredictorConfig
from wayfarer_lab.training.reward import REWARDS
from wayfarer_lab.training.run import TrainingRun

SMALL = PolicyConfig(
    epochs=2,
    starts=2,
    clones=2,
    primitives=2,
    snapshot_every=2,
    ppo=PpoSettings(batch=16, passes=1),
)


@pytest.fixture(scope="module")
def world():
    return environment()


@pytest.fixture(scope="module")
def trained(world, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "policy"
    assert train_policy(SMALL, world, folder)
    return folder


def weights_of(folder):
    return torch.load(folder / "last.pt", weights_only=True)["model"]


def test_every_epoch_can_be_seen(trained):
    assert (trained / "snapshots" / "epoch_00002.png").read_bytes().startswith(b"\x89PNG")
    lines = (trained / "log.txt").read_text().splitlines()
    assert len(lines) == 1
    for name in ("reward", "val/success", "val/steps", "val/broken", "val/reward/path"):
        assert f"{name} " in lines[-1]


def test_the_policy_has_moved_from_where_it_began(trained, world):
    fresh = PolicyTrainer(SMALL, world).model.state_dict()
    assert any(not torch.equal(fresh[k], v) for k, v in weights_of(trained).items())


def test_a_stopped_run_equals_one_that_was_not(trained, world, tmp_path, monkeypatch):
    """Ctrl-C after the first epoch, and the same command again: state and chance are saved."""
    whole_epoch = PolicyTrainer.update

    def stopped(self):
        if self.run.step == 1:
            raise KeyboardInterrupt
        return whole_epoch(self)

    monkeypatch.setattr(PolicyTrainer, "update", stopped)
    with pytest.raises(KeyboardInterrupt):
        train_policy(SMALL, world, tmp_path)
    monkeypatch.undo()
    assert train_policy(SMALL, world, tmp_path)
    whole, parts = weights_of(trained), weights_of(tmp_path)
    assert all(torch.allclose(whole[k], parts[k], atol=1e-6) for k in whole)


def test_the_critic_can_learn_first_while_the_actor_rests(world, tmp_path):
    config = SMALL.model_copy(update={"critic_epochs": 2})
    fresh = PolicyTrainer(config, world).model.state_dict()
    assert train_policy(config, world, tmp_path)
    moved = {k for k, v in weights_of(tmp_path).items() if not torch.equal(v, fresh[k])}
    assert moved and all(name.startswith("critic") for name in moved)


def test_it_can_begin_with_another_runs_policy(trained, world):
    config = SMALL.model_copy(update={"start_from": str(trained)})
    begun = PolicyTrainer(config, world).model.state_dict()
    assert all(torch.equal(begun[k], v) for k, v in weights_of(trained).items())


def test_reward_weights_are_checked():
    table = reward_weights({"path": 2.0, "goal": 1.0})
    assert table.tolist() == [2.0, *[0.0] * (len(REWARDS) - 2), 1.0]
    with pytest.raises(InvalidArgument, match=r"style.*allowed.*path"):
        reward_weights({"style": 1.0})
    with pytest.raises(InvalidArgument, match="0 or more"):
        reward_weights({"path": -1.0})


def test_a_predictor_of_the_other_seed_is_refused(tmp_path):
    model = MarkerPredictor(1)
    run = TrainingRun(
        tmp_path, PredictorConfig(seed_frames=1), model, torch.optim.SGD(model.parameters())
    )
    run.save()
    with pytest.raises(InvalidArgument, match="1 seed frames"):
        load_steps(PolicyConfig(seed_frames=2, predictor=str(tmp_path)))
    with pytest.raises(ArtifactError, match="cannot be read"):
        load_steps(PolicyConfig(predictor=str(tmp_path / "nothing")))


def test_the_shipped_recipe_acts_only_on_runs_that_it_makes():
    made = {f"runs/{path.stem}" for path in CONFIGS.glob("*.toml")}
    for path in CONFIGS.glob("policy_ppo*.toml"):
        config = read_config(PolicyConfig, path.stem)
        reward_weights(config.reward)
        used = {config.predictor, config.regressor_male, config.regressor_female, config.pose_prior}
        assert used <= made
        assert config.start_from in made | {""}
        assert str(config.seed_frames) in config.predictor
