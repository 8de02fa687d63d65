"""Commands that need torch: `wayfarer train …`."""

import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

import torch
import typer
from pydantic import BaseModel, ValidationError

from wayfarer.body.library import load_body
from wayfarer.errors import InvalidArgument
from wayfarer.models.artifacts import ASSETS
from wayfarer.process.processor import cores
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer_lab.training.cloning import CloningConfig, train_cloning
from wayfarer_lab.training.dataset import Frames, load_frames, load_poses
from wayfarer_lab.training.end_to_end import EndToEndConfig, train_end_to_end
from wayfarer_lab.training.following import FollowingConfig, train_following
from wayfarer_lab.training.goal_cvae import GoalCvaeConfig, train_goal_cvae
from wayfarer_lab.training.policy import PolicyConfig, load_environment, train_policy
from wayfarer_lab.training.pose_prior import PosePriorConfig, train_pose_prior
from wayfarer_lab.training.predictor import PredictorConfig, train_predictor
from wayfarer_lab.training.regressor import RegressorConfig, train_regressor
from wayfarer_lab.training.stages import StageList, Stages
from wayfarer_lab.training.unpack import unpack_models

app = typer.Typer(
    help="Train the networks. A run lives in a folder and resumes from its checkpoint. "
    "docs/models.md has the recipe.",
    no_args_is_help=True,
    add_completion=False,
)
CONFIGS = Path(__file__).parent / "configs"
SHIPPED = ASSETS / "models" / "gamma-anny52"
Config = TypeVar("Config", bound=BaseModel)

ConfigOption = Annotated[
    str,
    typer.Option(help="A TOML file, or the name of a config in lab/wayfarer_lab/training/configs."),
]
DataOption = Annotated[
    Path,
    typer.Option(help="Folder made by `wayfarer data prepare`."),
]
OutOption = Annotated[
    Path, typer.Option(help="Folder of this run; if it has a checkpoint, the run resumes.")
]
MinutesOption = Annotated[
    float,
    typer.Option(
        help="Stop after this time; the same command resumes.", show_default="until finished"
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="NAME=VALUE in place of the config's value, as often as needed: --set steps=800",
        show_default="nothing",
    ),
]
ThreadsOption = Annotated[int, typer.Option(help="CPU threads; 0: torch chooses.")]


def read_config(kind: type[Config], name: str, changes: Sequence[str] = ()) -> Config:
    """Parse a config file, with some of its top values changed: "steps=800", as TOML has them.

    Raises InvalidArgument naming the field and the allowed ones.
    """
    path = Path(name) if name.endswith(".toml") else CONFIGS / f"{name}.toml"
    if not path.exists():
        known = sorted(
            p.relative_to(CONFIGS).with_suffix("").as_posix() for p in CONFIGS.rglob("*.toml")
        )
        raise InvalidArgument(f"no config {path}; shipped ones: {known}", "config")
    try:
        return kind.model_validate(tomllib.loads(path.read_text()) | _changed(changes))
    except (tomllib.TOMLDecodeError, ValidationError) as error:
        raise InvalidArgument(
            f"{path}: {error}\nallowed keys: {sorted(kind.model_fields)}", "config"
        ) from None


def _changed(changes: Sequence[str]) -> dict[str, Any]:
    """NAME=VALUE by name; a value that is no TOML is a string."""
    found: dict[str, Any] = {}
    for change in changes:
        name, equals, value = change.partition("=")
        if not equals or not name.isidentifier():
            raise InvalidArgument(f"{change!r} is not NAME=VALUE", "set")
        try:
            found |= tomllib.loads(change)
        except tomllib.TOMLDecodeError:
            found[name] = value
    return found


Train = Callable[[Config, Path, Path, float], bool]
"""Settings, data folder, run folder and minutes; True: finished."""


USAGE = cast(type[Exception], typer.BadParameter.__bases__[0])
"""Error of a wrong command line: newer versions of typer contain a copy of click."""
KINDS: dict[str, type[BaseModel]] = {}
"""Settings by the name of the training."""


def training(
    name: str, kind: type[Config], usual: str, short_help: str
) -> Callable[[Train[Config]], Train[Config]]:
    """`wayfarer train NAME`: the options that all trainings have, and the help of the function."""

    def register(train: Train[Config]) -> Train[Config]:
        def command(
            data: DataOption,
            out: OutOption,
            config: ConfigOption = usual,
            changes: SetOption = None,
            minutes: MinutesOption = float("inf"),
            threads: ThreadsOption = 0,
        ) -> None:
            torch.set_num_threads(threads or min(torch.get_num_threads(), cores()))
            done = train(read_config(kind, config, changes or ()), data, out, minutes)
            typer.echo(f"{out}: finished" if done else f"{out}: stopped; the same command resumes")

        command.__doc__ = train.__doc__
        KINDS[name] = kind
        app.command(name, short_help=short_help)(command)
        return train

    return register


def _frames(data: Path, mix: Mapping[str, float]) -> tuple[Frames, Frames]:
    """Those of training and of validation."""
    return load_frames(data, "train", mix), load_frames(data, "validation", mix)


@training("predictor", PredictorConfig, "predictor_2f", "Train a marker predictor (Eq. 1).")
def predictor(settings: PredictorConfig, data: Path, out: Path, minutes: float) -> bool:
    """Train a marker predictor (Eq. 1 of the paper), on single primitives or on rollouts."""
    return train_predictor(settings, *_frames(data, settings.mix), out, minutes)


@training(
    "regressor",
    RegressorConfig,
    "regressor_female",
    "Train the body regressor of a gender (Eq. 2).",
)
def regressor(settings: RegressorConfig, data: Path, out: Path, minutes: float) -> bool:
    """Train the body regressor of one gender (Eq. 2 of the paper)."""
    body = load_body("anny52", settings.gender)
    return train_regressor(settings, *_frames(data, settings.mix), body, out, minutes)


@training("pose-prior", PosePriorConfig, "pose_prior", "Train the pose prior, a VAE of poses.")
def pose_prior(settings: PosePriorConfig, data: Path, out: Path, minutes: float) -> bool:
    """Train the pose prior, a VAE of poses in the role of VPoser, for policy and evaluation."""
    train, validation = (load_poses(data, split, settings.mix) for split in ("train", "validation"))
    return train_pose_prior(settings, train, validation, out, minutes)


@training("policy", PolicyConfig, "policy_ppo", "Train the goal policy by PPO (Eq. 10).")
def policy(settings: PolicyConfig, data: Path, out: Path, minutes: float) -> bool:
    """Train the goal policy by PPO in simulation (Eq. 10 of the paper).

    The config names the runs of the trained networks.
    """
    moving = load_poses(data, "train", settings.moving_mix)
    standing = torch.from_numpy(load_start_poses(ASSETS / "start_poses.npz"))
    return train_policy(settings, load_environment(settings, moving, standing), out, minutes)


@training(
    "policy-clone",
    CloningConfig,
    "policy_cloned",
    "Clone the policy from recordings, in hindsight.",
)
def policy_clone(settings: CloningConfig, data: Path, out: Path, minutes: float) -> bool:
    """Clone the policy that serves: what recorded people did is the answer to where they went.

    The config names the runs of the trained networks. val/kl is the divergence of the policy from
    the codes of people it has not seen, per latent dimension.
    """
    return train_cloning(settings, *_frames(data, settings.mix), out, minutes)


@training(
    "policy-follow",
    FollowingConfig,
    "policy_following",
    "Teach a cloned policy to follow in closed loop.",
)
def policy_follow(settings: FollowingConfig, data: Path, out: Path, minutes: float) -> bool:
    """Teach a cloned policy to follow what is asked, by its own steps, and to set its feet.

    The log shows m/s off the way, soles' slide in m/s, and the divergence from the cloned policy.
    """
    return train_following(settings, *_frames(data, settings.mix), out, minutes)


@training("goal-cvae", GoalCvaeConfig, "goal_cvae", "Train the baseline, a goal-conditioned CVAE.")
def goal_cvae(settings: GoalCvaeConfig, data: Path, out: Path, minutes: float) -> bool:
    """Train the goal-conditioned CVAE (Sec. 4.2), the baseline of `wayfarer eval control`."""
    return train_goal_cvae(settings, *_frames(data, settings.mix), out, minutes)


@training(
    "end-to-end",
    EndToEndConfig,
    "paper/end_to_end",
    "Train predictor and regressors together (Eq. 12).",
)
def end_to_end(settings: EndToEndConfig, data: Path, out: Path, minutes: float) -> bool:
    """Train a predictor and both regressors together (Sec. B.1, Eq. 12), from trained ones.

    The results are separate runs in the run's folder, for --runs of export and eval.
    """
    return train_end_to_end(settings, *_frames(data, settings.mix), out, minutes)


@app.command("all", short_help="Run a list of stages, from recordings to models.")
def everything(
    config: Annotated[
        str, typer.Option(help="A list of stages: a TOML file, or the name of a shipped one.")
    ] = "next",
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            help="NAME=VALUE in place of a value or the folder of the list: --set folder=runs/two",
            show_default="nothing",
        ),
    ] = None,
    status: Annotated[
        bool, typer.Option("--status", help="Only say which stages are done, and the time left.")
    ] = False,
    minutes: MinutesOption = float("inf"),
) -> None:
    """Run a list of stages, each a command of `wayfarer`; finished ones are skipped.

    Ctrl-C, `kill` and --minutes stop after the running stage's checkpoint, and the same command
    resumes inside that stage.
    """
    stages = Stages(_with_values(read_config(StageList, config), changes or ()), _training_of)
    if status:
        for line in stages.lines():
            typer.echo(line)
        return
    done = stages.run(minutes, typer.echo)
    typer.echo("all stages are done" if done else "stopped; the same command resumes")


def _with_values(wanted: StageList, changes: Sequence[str]) -> StageList:
    changed = _changed(changes)
    folder = str(changed.pop("folder", wanted.folder))
    if unknown := changed.keys() - wanted.values.keys():
        known = sorted({"folder", *wanted.values})
        raise InvalidArgument(f"no value {sorted(unknown)}; the list has {known}", "set")
    return wanted.model_copy(update={"folder": folder, "values": wanted.values | changed})


def _training_of(arguments: tuple[str, ...]) -> tuple[Path, BaseModel] | None:
    """Run folder and settings of a training's command line. Raises InvalidArgument."""
    if arguments[:1] != ("train",) or arguments[1:2] == () or arguments[1] not in KINDS:
        return None
    commands = cast(Any, typer.main.get_command(app)).commands
    try:
        given = commands[arguments[1]].make_context(arguments[1], list(arguments[2:])).params
    except USAGE as error:
        raise InvalidArgument(cast(Any, error).format_message(), "command") from None
    settings = read_config(KINDS[arguments[1]], given["config"], given["changes"] or ())
    return Path(given["out"]), settings


@app.command(short_help="Turn a model folder into run folders.")
def unpack(
    runs: Annotated[Path, typer.Argument(help="Folder in which to write the run folders.")],
    models: Annotated[
        Path, typer.Option(help="Model folder.", show_default="the shipped model")
    ] = SHIPPED,
) -> None:
    """Write the weights of a model folder as run folders, for `start_from` or for export.

    A model folder holds neither the predictor's encoder nor the policy's critic; a training that
    starts from such a run initialises them.
    """
    for name, tensors in unpack_models(models, runs).items():
        typer.echo(f"{runs / name}: {tensors} tensors")
