"""`wayfarer eval paper`: the page that has the paper's tables beside ours."""

import json as json_module
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from wayfarer.errors import DataError, InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL, open_bundle
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.commands import options
from wayfarer_lab.evaluation.commands.shared import write_figures
from wayfarer_lab.evaluation.paper.page import page
from wayfarer_lab.evaluation.paper.results import ResultsFolder
from wayfarer_lab.evaluation.report import console

app = typer.Typer()

RESULTS: Final = Path("benchmarks/results")

BENCHMARK: Final = "performance_*.json"
"""Result of `python -m benchmarks.record`; its part `paper_s3_onnxruntime` is Table S3."""


SHOWN_POSES: Final = 4
"""Poses of the pose prior: the one of all shapes in Fig. S2, and three more."""
FIGURES: Final = "figures.json"
"""Result of `wayfarer eval figures`: motions, of which the page's pictures are drawn."""
FAILURES: Final = "failures.json"
"""Result of `wayfarer eval failures`: poses, of which pictures are drawn."""


@app.command(short_help="The motions that the paper's pictures show (Fig. 4, S1, S2).")
def figures(
    models: options.Models = DEFAULT_MODEL,
    runs: options.Runs = None,
    policy_10: options.Policy10 = None,
    policy_1: options.Policy1 = None,
    g_cvae: options.GoalCvae = None,
    threads: options.Threads = 0,
    seed: options.Seed = 0,
    json: Annotated[Path, typer.Option(help="File to write.")] = RESULTS / FIGURES,
) -> None:
    """Make the motions that the paper's pictures show, and keep their joints as JSON.

    `wayfarer eval paper` draws them. Fig. 4: one body to one goal by each method, the clone that
    arrives first or comes nearest. Fig. S1: six primitives of each predictor from one seed, with
    the same latents. Fig. S2: four shapes from one pose, and three poses of the pose prior.
    """
    from wayfarer_lab.evaluation.model_parts import load_parts
    from wayfarer_lab.evaluation.paper.motion import corner_cases, methods, seeded_primitives
    from wayfarer_lab.evaluation.rollout import prior_poses

    report.check_origin()
    parts = load_parts(models, runs, threads)
    if parts.pose_prior is None:
        raise InvalidArgument(f"{models} holds no pose prior to draw poses from", "models")
    shipped = open_bundle(models, threads)
    found = {"N(0, I)": (shipped, 0.0)}
    if g_cvae:
        found["g-CVAE"] = (open_bundle(g_cvae, threads), 0.0)
    for name, folder in (("policy(10)", policy_10), ("policy(1)", policy_1)):
        if folder:
            found[name] = (open_bundle(folder, threads), 1.0)
    if shipped.has_policy:
        found["policy, shipped"] = (shipped, 1.0)
    starts = prior_poses(parts.pose_prior, 2 * SHOWN_POSES, np.random.default_rng(seed))[0]
    made = {
        "fig_4": methods(found, seed),
        "fig_s1": seeded_primitives(parts, seed),
        "fig_s2": corner_cases(parts, starts, seed),
    }
    write_figures(json, made, {"seed": seed, "models": str(models)})


@app.command(short_help="The paper's tables and figures beside ours, as a page.")
def paper(
    results: Annotated[
        Path,
        typer.Option(help="Folder of results: `wayfarer eval TABLE --json FOLDER/TABLE.json`."),
    ] = RESULTS,
    out: Annotated[Path, typer.Option(help="Markdown file to write.")] = RESULTS / "paper.md",
) -> None:
    """Write the paper's tables and figures beside ours, from JSON results alone.

    Rows are found by the names of files and rows: TABLE.json, or TABLE_paper*.json for networks
    that were trained as the paper has it; several such files stand for several trainings and give
    mean and range. What is missing is named, with the reason. Pictures are drawn from figures.json
    and failures.json into images/ beside the page. Nothing is measured here: see `wayfarer eval
    --help` for the tables.
    """
    drawn = draw_figures(results / FIGURES, out.parent / "images")
    drawn |= draw_figures(results / FAILURES, out.parent / "images")
    text = page(ResultsFolder(results), results.as_posix(), runtime(results), drawn)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(text, encoding="utf-8")
    console.print(f"wrote {out}", highlight=False)


def draw_figures(path: Path, folder: Path) -> dict[str, str]:
    """Draws the motions of a result; returns file names by picture, none without a result.

    Raises DataError when it is not as `wayfarer eval figures` writes.
    """
    from wayfarer_lab.evaluation.paper.draw import pictures

    if not path.exists():
        return {}
    try:
        figures = json_module.loads(path.read_text(encoding="utf-8"))["figures"]
        if path.name == FAILURES:
            from wayfarer_lab.evaluation.direct import draw_poses

            made = {"fig_s3": draw_poses(figures)}
        else:
            made = pictures(figures)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise DataError(f"{path}: holds no motions to draw: {error!r}") from None
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in made.items():
        picture.quantize(64).save(folder / f"paper_{name}.png", optimize=True)
    return {name: f"paper_{name}.png" for name in made}


def runtime(folder: Path) -> dict[int, float] | None:
    """Seconds of a primitive by number of bodies, as a server cuts them into calls.

    None when no benchmark is there; raises DataError when it is not as `benchmarks.record` writes.
    """
    found = sorted(folder.glob(BENCHMARK))
    if not found:
        return None
    try:
        rows = json_module.loads(found[-1].read_text(encoding="utf-8"))["parts"][
            "paper_s3_onnxruntime"
        ]
        return {
            int(row["bodies"]): min(float(row["one_call_s"]), float(row["best_calls_s"]))
            for row in rows["rows"]
        }
    except (ValueError, KeyError, TypeError) as error:
        raise DataError(f"{found[-1]}: holds no Table S3: {error!r}") from None
