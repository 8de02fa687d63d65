"""Commands that need torch: `wayfarer train …` and `wayfarer export`."""

import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, TypeVar

import torch
import typer
from pydantic import BaseModel, ValidationError

from wayfarer.artifacts import ASSETS
from wayfarer.body.library import load_body
from wayfarer.errors import InvalidArgument
from wayfarer.motion.regressor import PASSES
from wayfarer.spec import GENDERS
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer_lab.training.analytic import AnalyticConfig, train_analytic
from wayfarer_lab.training.card import model_card
from wayfarer_lab.training.dataset import load_frames, load_poses
from wayfarer_lab.training.export import Sources, export_models, write_models
from wayfarer_lab.training.goal_cvae import GoalCvaeConfig, load_goal_cvae_graphs, train_goal_cvae
from wayfarer_lab.training.policy import PolicyConfig, load_environment, train_policy
from wayfarer_lab.training.pose_prior import PosePriorConfig, train_pose_prior
from wayfarer_lab.training.predictor import PredictorConfig, train_predictor
from wayfarer_lab.training.regressor import RegressorConfig, train_regressor
from wayfarer_lab.training.unpack import unpack_models

app = typer.Typer(
    help="Train networks. Each run lives in a folder and resumes from its checkpoint."
)
CONFIGS = Path(__file__).parent / "configs"
SHIPPED = ASSETS / "models" / "gamma-anny52"
Config = TypeVar("Config", bound=BaseModel)

ConfigOption = Annotated[
    str, typer.Option(help="A TOML file, or the name of one in training/configs.")
]
DataOption = Annotated[Path, typer.Option(help="A folder made by `wayfarer data prepare`.")]
OutOption = Annotated[
    Path, typer.Option(help="Folder of this run; resumes when it has a checkpoint.")
]
MinutesOption = Annotated[float, typer.Option(help="Stop after this long; run again to go on.")]
ThreadsOption = Annotated[int, typer.Option(help="CPU threads; 0 leaves torch's choice.")]


def read_config(kind: type[Config], name: str) -> Config:
    """Parse a config file. Raises InvalidArgument naming the field and the allowed ones."""
    path = Path(name) if name.endswith(".toml") else CONFIGS / f"{name}.toml"
    if not path.exists():
        known = sorted(p.stem for p in CONFIGS.glob("*.toml"))
        raise InvalidArgument(f"no config {path}; shipped ones: {known}", "config")
    try:
        return kind.model_validate(tomllib.loads(path.read_text()))
    except (tomllib.TOMLDecodeError, ValidationError) as error:
        raise InvalidArgument(
            f"{path}: {error}\nallowed keys: {sorted(kind.model_fields)}", "config"
        ) from None


@app.command()
def predictor(
    data: DataOption,
    out: OutOption,
    config: ConfigOption = "predictor_2f",
    minutes: MinutesOption = float("inf"),
    threads: ThreadsOption = 0,
) -> None:
    """Train a marker predictor (paper Eq. 1): one primitive at a time, or over rollouts."""
    _threads(threads)
    settings = read_config(PredictorConfig, config)
    train, validation = (
        load_frames(data, split, settings.mix) for split in ("train", "validation")
    )
    _finished(train_predictor(settings, train, validation, out, minutes), out)


@app.command()
def regressor(
    data: DataOption,
    out: OutOption,
    config: ConfigOption = "regressor_female",
    minutes: MinutesOption = float("inf"),
    threads: ThreadsOption = 0,
) -> None:
    """Train a body regressor (paper Eq. 2) for one gender."""
    _threads(threads)
    settings = read_config(RegressorConfig, config)
    body = load_body("anny52", settings.gender)
    train, validation = (
        load_frames(data, split, settings.mix) for split in ("train", "validation")
    )
    _finished(train_regressor(settings, train, validation, body, out, minutes), out)


@app.command()
def pose_prior(
    data: DataOption,
    out: OutOption,
    config: ConfigOption = "pose_prior",
    minutes: MinutesOption = float("inf"),
    threads: ThreadsOption = 0,
) -> None:
    """Train the pose prior, a VAE of poses in VPoser's role (for the policy and evaluation)."""
    _threads(threads)
    settings = read_config(PosePriorConfig, config)
    train, validation = (load_poses(data, split, settings.mix) for split in ("train", "validation"))
    _finished(train_pose_prior(settings, train, validation, out, minutes), out)


@app.command()
def policy(
    data: DataOption,
    out: OutOption,
    config: ConfigOption = "policy_ppo",
    minutes: MinutesOption = float("inf"),
    threads: ThreadsOption = 0,
) -> None:
    """Train the goal policy by PPO in simulation (paper Eq. 10) on trained networks."""
    _threads(threads)
    settings = read_config(PolicyConfig, config)
    moving = load_poses(data, "train", settings.moving_mix)
    standing = torch.from_numpy(load_start_poses(ASSETS / "start_poses.npz"))
    environment = load_environment(settings, moving, standing)
    _finished(train_policy(settings, environment, out, minutes), out)


@app.command("policy-analytic")
def policy_analytic(
    data: DataOption,
    out: OutOption,
    config: ConfigOption = "policy_analytic",
    minutes: MinutesOption = float("inf"),
    threads: ThreadsOption = 0,
) -> None:
    """Train the policy by analytic gradients of the quality terms: the start of the recipe."""
    _threads(threads)
    settings = read_config(AnalyticConfig, config)
    train, validation = (
        load_frames(data, split, settings.mix) for split in ("train", "validation")
    )
    _finished(train_analytic(settings, train, validation, out, minutes), out)


@app.command("goal-cvae")
def goal_cvae(
    data: DataOption,
    out: OutOption,
    config: ConfigOption = "goal_cvae",
    minutes: MinutesOption = float("inf"),
    threads: ThreadsOption = 0,
) -> None:
    """Train the baseline of `wayfarer eval control`, the goal-conditioned CVAE (paper Sec. 4.2)."""
    _threads(threads)
    settings = read_config(GoalCvaeConfig, config)
    train, validation = (
        load_frames(data, split, settings.mix) for split in ("train", "validation")
    )
    _finished(train_goal_cvae(settings, train, validation, out, minutes), out)


@app.command()
def unpack(
    runs: Annotated[Path, typer.Argument(help="Folder to write run folders into.")],
    models: Annotated[Path, typer.Option(help="Model folder.")] = SHIPPED,
) -> None:
    """Write run folders with a model folder's weights, to go on from (`start_from`) or to export.

    The predictor's encoder and the policy's critic are not in a model folder: they begin anew.
    """
    for name, tensors in unpack_models(models, runs).items():
        typer.echo(f"{runs / name}: {tensors} tensors")


def _threads(count: int) -> None:
    if count:
        torch.set_num_threads(count)


def _finished(done: bool, out: Path) -> None:
    typer.echo(f"{out}: finished" if done else f"{out}: stopped; run the same command to go on")


def export(
    runs: Annotated[
        Path, typer.Option(help="Folder of finished runs, named as their configs.")
    ] = Path("runs"),
    out: Annotated[Path, typer.Option(help="Model folder to write.")] = SHIPPED,
    data: Annotated[
        Path | None, typer.Option(help="Prepared folder, described in the card.")
    ] = None,
    policy: Annotated[str, typer.Option(help="Run of the policy.")] = "policy",
    predictor_1f: Annotated[
        str, typer.Option(help="Run of the 1-frame predictor.")
    ] = "predictor_1f_rollout",
    predictor_2f: Annotated[
        str, typer.Option(help="Run of the 2-frame predictor.")
    ] = "predictor_2f_rollout",
    goal_cvae: Annotated[
        str, typer.Option(help="Run of the g-CVAE: write a folder of that baseline instead.")
    ] = "",
    passes: Annotated[
        int, typer.Option(min=1, help="Of the regressor: 2 make a lighter model (docs/models.md).")
    ] = PASSES,
) -> None:
    """Write trained networks as the ONNX graphs that serve. Fails unless torch and ONNX agree."""
    sources = Sources(
        policy=runs / policy,
        predictor_1f=runs / predictor_1f,
        predictor_2f=runs / predictor_2f,
        regressor_male=runs / "regressor_male",
        regressor_female=runs / "regressor_female",
        pose_prior=runs / "pose_prior",
    )
    if goal_cvae:
        regressors = {gender: runs / f"regressor_{gender}" for gender in GENDERS}
        trained = {"goal_cvae": runs / goal_cvae} | regressors
        graphs = load_goal_cvae_graphs(runs / goal_cvae, regressors)
        written = write_models(graphs, out, model_card(out.name, trained, data), out.name)
    else:
        card = model_card(out.name, asdict(sources), data)
        written = export_models(sources, out, card, out.name, passes=passes)
    for file, difference in written.items():
        typer.echo(f"{file}: torch and ONNX differ by at most {difference:.1e}")
