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
from wayfarer.training.card import model_card
from wayfarer.training.dataset import load_frames, marker_body
from wayfarer.training.export import Sources, export_models
from wayfarer.training.predictor import PredictorConfig, train_predictor
from wayfarer.training.regressor import RegressorConfig, train_regressor

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
    body = marker_body(load_body("anny52", settings.gender))
    train, validation = (
        load_frames(data, split, settings.mix) for split in ("train", "validation")
    )
    _finished(train_regressor(settings, train, validation, body, out, minutes), out)


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
    predictor_1f: Annotated[
        str, typer.Option(help="Run of the 1-frame predictor.")
    ] = "predictor_1f_rollout",
    predictor_2f: Annotated[
        str, typer.Option(help="Run of the 2-frame predictor.")
    ] = "predictor_2f_rollout",
) -> None:
    """Write trained networks as the ONNX graphs that serve. Fails unless torch and ONNX agree."""
    sources = Sources(
        predictor_1f=runs / predictor_1f,
        predictor_2f=runs / predictor_2f,
        regressor_male=runs / "regressor_male",
        regressor_female=runs / "regressor_female",
    )
    card = model_card(out.name, asdict(sources), data)
    for file, difference in export_models(sources, out, card, out.name).items():
        typer.echo(f"{file}: torch and ONNX differ by at most {difference:.1e}")
