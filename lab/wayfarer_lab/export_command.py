"""`wayfarer export`: trained runs as the model folder that serves, or a model for game engines."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from wayfarer.errors import InvalidArgument
from wayfarer.models.artifacts import ASSETS

SHIPPED = ASSETS / "models" / "gamma-anny52"
OUT = {"engines": Path("wayfarer_engines"), "web": Path("wayfarer_web")}


class ExportTarget(StrEnum):
    """What is written."""

    SERVER = "server"
    ENGINES = "engines"
    WEB = "web"


def export(
    target: Annotated[
        ExportTarget,
        typer.Option(
            "--for",
            help="server: trained runs as a model folder (needs torch). engines: a model folder as "
            "graphs for Unity, Unreal and ONNX Runtime; web: the same for pages, smaller to load "
            "(both need the package onnx).",
        ),
    ] = ExportTarget.SERVER,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder to write.",
            show_default="the shipped model's folder, wayfarer_engines or wayfarer_web",
        ),
    ] = None,
    models: Annotated[
        Path | None,
        typer.Option(help="engines, web: model folder to take.", show_default="the shipped model"),
    ] = None,
    candidates: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=16,
            help="engines, web: candidates K of a step; 1 is the policy alone, and cheapest.",
            show_default="1",
        ),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option(
            help="web: a scene to walk in, too, on one level floor: an example's name (town_square "
            "...) or a level (.glb, .obj, .ply). Without it, a floor without end.",
            show_default="none",
        ),
    ] = None,
    runs: Annotated[
        Path | None,
        typer.Option(
            help="server: folder of finished runs. Folders are named as in docs/models.md.",
            show_default="runs",
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(help="server: folder made by `wayfarer data prepare`; the card describes it."),
    ] = None,
    policy: Annotated[
        str | None, typer.Option(help="server: run of the policy.", show_default="policy")
    ] = None,
    predictor_1f: Annotated[
        str | None,
        typer.Option(
            help="server: run of the 1-frame predictor.", show_default="predictor_1f_rollout"
        ),
    ] = None,
    predictor_2f: Annotated[
        str | None,
        typer.Option(
            help="server: run of the 2-frame predictor.", show_default="predictor_2f_rollout"
        ),
    ] = None,
    goal_cvae: Annotated[
        str | None,
        typer.Option(help="server: run of the goal-conditioned CVAE: write that baseline instead."),
    ] = None,
) -> None:
    """Write a model in the form that something else runs.

    --for server turns trained networks into a model folder: ONNX graphs, manifest and card. It
    fails unless torch and ONNX agree.

    --for engines turns a model folder into files that a game engine runs without a server: for each
    gender one self-contained float32 ONNX graph and a file with the body and start poses; and
    wayfarer.json and README.md, which document every input, output and constant. It fails unless
    onnx.checker, the engines' tables of operators and the served engine agree. For example:

    wayfarer export --for engines --out Assets/Wayfarer

    --for web is the same for the web client's local mode: the two graphs share one file of float16
    weights, 10 MB in all instead of 27. With --scene people walk around what stands there, and
    around each other:

    wayfarer export --for web --out public/people --scene town_square
    """
    of_runs = {
        "runs": runs, "data": data, "policy": policy, "predictor_1f": predictor_1f,
        "predictor_2f": predictor_2f, "goal_cvae": goal_cvae,
    }  # fmt: skip
    if target is not ExportTarget.SERVER:
        _refuse(of_runs, target, "server")
        if target is not ExportTarget.WEB:
            _refuse({"scene": scene}, target, "web")
        _for_engines(models or SHIPPED, out or OUT[target], candidates or 1, target, scene)
    else:
        _refuse({"models": models, "candidates": candidates}, target, "engines or web")
        _refuse({"scene": scene}, target, "web")
        _for_server(out or SHIPPED, {k: value for k, value in of_runs.items() if value is not None})


def _refuse(options: dict[str, Any], target: ExportTarget, other: str) -> None:
    for name, value in options.items():
        if value is not None:
            flag = "--" + name.replace("_", "-")
            raise InvalidArgument(f"{flag} is for --for {other}; this is --for {target}", name)


def _for_engines(
    models: Path, out: Path, candidates: int, target: ExportTarget, scene: str | None
) -> None:
    from wayfarer_lab.engine_export.export import export_for_engines
    from wayfarer_lab.engine_export.scene import read_scene, write_scene

    spec = read_scene(scene) if scene else None  # fails before anything is written
    halves = target is ExportTarget.WEB
    export_for_engines(models, out, candidates, typer.echo, halves=halves)
    if spec:
        write_scene(spec, out / "scene")
        typer.echo(f"{out / 'scene'}: {scene}")
    typer.echo(f"{out}: written; start with {out / 'README.md'}")


def _for_server(out: Path, given: dict[str, Any]) -> None:
    from wayfarer_lab.training.export_runs import export_runs

    usual: dict[str, Any] = {
        "runs": Path("runs"), "data": None, "policy": "policy",
        "predictor_1f": "predictor_1f_rollout", "predictor_2f": "predictor_2f_rollout",
        "goal_cvae": "",
    }  # fmt: skip
    for file, difference in export_runs(out=out, **usual | given).items():
        typer.echo(f"{file}: torch and ONNX differ by at most {difference:.1e}")
