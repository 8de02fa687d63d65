"""The model that is measured, and the engines that can run it here."""

import argparse
from importlib.util import find_spec
from pathlib import Path
from typing import Final, cast

from wayfarer.engines.choice import open_engine
from wayfarer.engines.engine import Engine, EngineKind
from wayfarer.models.bundle import DEFAULT_MODEL, load_models
from wayfarer.spec import GENDERS, SEED_FRAMES

GENDER: Final = GENDERS[0]
"""Both step graphs have the same shapes; one is enough."""

DEFAULT_ENGINE: Final = "onnxruntime"

ENGINES: Final = (DEFAULT_ENGINE, *(("openvino",) if find_spec("openvino") else ()))
"""Engines for the CPU that are installed. The GPU has its own benchmark."""


def opened(engine: str, threads: int, model: Path = DEFAULT_MODEL) -> Engine:
    """An engine of ENGINES over a model's folder."""
    return open_engine(load_models(model), cast(EngineKind, engine), threads)


def step_graph(model: Path = DEFAULT_MODEL) -> Path:
    """The step of a model as ONNX."""
    return load_models(model).graph("step", GENDER, SEED_FRAMES)


def add_engine(parser: argparse.ArgumentParser) -> None:
    """The option `--engine`."""
    parser.add_argument("--engine", choices=ENGINES, default=DEFAULT_ENGINE)
