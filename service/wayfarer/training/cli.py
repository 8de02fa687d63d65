"""Commands that need torch: `wayfarer train …` and `wayfarer export`."""

import tomllib
from pathlib import Path
from typing import Annotated, TypeVar

import torch
import typer
from pydantic import BaseModel, ValidationError

from wayfarer.body.library import load_body
from wayfarer.errors import InvalidArgument
from wayfarer.training.dataset import load_frames, marker_body
from wayfarer.training.predictor import PredictorConfig, train_predictor
from wayfarer.training.regressor import RegressorConfig, train_regressor

app = typer.Typer(help="Train networks. Each run lives in a folder and resumes from its checkpoint.")
CONFIGS = Path(__file__).parent / "configs"
Config = TypeVar("Config", bound=BaseModel)

ConfigOption = Annotated[str, typer.Option(help="A TOML file, or the name of one in training/configs.")]
DataOption = Annotated[Path, typer.Option(help="A folder made by `wayfarer data prepare`.")]
OutOption = Annotated[Path, typer.Option(help="Folder of this run; resumes when it has a checkpoint.")]
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
        raise InvalidArgument(f"{path}: {error}\nallowed keys: {sorted(kind.model_fields)}", "config") from None


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
    done = train_predictor(settings, load_frames(data, "train"), load_frames(data, "validation"), out, minutes)
    _finished(done, out)


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
    frames = [load_frames(data, split, poses_only=True) for split in ("train", "validation")]
    _finished(train_regressor(settings, frames[0], frames[1], body, out, minutes), out)


def _threads(count: int) -> None:
    if count:
        torch.set_num_threads(count)


def _finished(done: bool, out: Path) -> None:
    typer.echo(f"{out}: finished" if done else f"{out}: stopped; run the same command to go on")
