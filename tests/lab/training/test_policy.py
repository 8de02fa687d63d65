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
from wayfarer_lab.training.reward import PAPER_REWARD, REWARDS
from wayfarer_lab.training.run import TrainingRun, read_effort

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


def test_the_paper_s_epoch_trains_on_primitives_of_both_models(tmp_path):
    settings = {"ends": "all", "lead": "told by the environment", "epochs": 1}
    ppo = {"ppo": SMALL.ppo.model_copy(update={"normalised_over": "clones"})}
    assert train_policy(
        SMALL.model_copy(update=settings | ppo), environment(lead=True), tmp_path / "policy"
    )
    assert all(torch.isfinite(v).all() for v in weights_of(tmp_path / "policy").values())
    assert read_effort(tmp_path / "policy").cpu_minutes >= 0


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
        load_steps(PolicyConfig(), str(tmp_path), 2)
    with pytest.raises(ArtifactError, match="cannot be read"):
        load_steps(PolicyConfig(), str(tmp_path / "nothing"), 2)


def test_the_shipped_recipe_acts_only_on_runs_that_it_makes():
    names = {
        path.relative_to(CONFIGS).with_suffix("").as_posix() for path in CONFIGS.rglob("*.toml")
    }
    made = {f"runs/{name}" for name in names}
    for name in sorted(n for n in names if "policy_ppo" in n or "paper/policy" in n):
        config = read_config(PolicyConfig, name)
        reward_weights(config.reward)
        used = {config.predictor, config.regressor_male, config.regressor_female, config.pose_prior}
        assert used <= made
        assert {config.start_from, config.lead} <= made | {""}
        assert str(config.seed_frames) in config.predictor


def test_the_paper_s_policies_are_the_paper_s():
    for weight in (10, 1):
        config = read_config(PolicyConfig, f"paper/policy_{weight}")
        assert config.reward == PAPER_REWARD and config.ends == "all" and config.lead
        assert (config.starts, config.clones, config.primitives, config.epochs) == (8, 32, 60, 500)
        ppo = config.ppo
        assert (ppo.discount, ppo.gae, ppo.clip, ppo.kl_limit) == (0.99, 1.0, 0.2, 0.02)
        assert ppo.prior_weight == weight and ppo.normalised_over == "clones"
        assert (config.task.near_share, config.task.reached, config.task.area) == (0, 0.75, 20)


def test_the_cheaper_estimator_is_of_the_paper_s_reward():
    config = read_config(PolicyConfig, "paper/policy_10_approach")
    assert config.reward == PAPER_REWARD and not config.start_from
    assert (config.ppo.discount, config.ppo.clip, config.ppo.prior_weight) == (0.99, 0.2, 10.0)


def test_the_first_epochs_go_at_half_the_rate(world, tmp_path):
    ppo = SMALL.ppo.model_copy(update={"slow_epochs": 1, "rate": 1e-4})
    trainer = PolicyTrainer(SMALL.model_copy(update={"ppo": ppo}), world)
    trainer.run = TrainingRun(tmp_path, trainer.config, trainer.model, trainer.optimizer)
    rates = []
    for trainer.run.step in range(2):
        trainer.update()
        rates.append(trainer.optimizer.param_groups[0]["lr"])
    assert rates == [5e-5, 1e-4]
