"""`wayfarer render`: clips, recordings and random runs as strips, sheets, plans and films."""

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

import typer
from PIL import Image

from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer.errors import InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL, open_bundle
from wayfarer.world.goals.steering import Steering
from wayfarer_lab.evaluation import report
from wayfarer_lab.evaluation.pictures.files import (
    FILMS,
    choose_kind,
    film_rate,
    write_film,
    write_still,
)
from wayfarer_lab.evaluation.pictures.film import crowd_film, follow_film, gathered
from wayfarer_lab.evaluation.pictures.framing import check_view
from wayfarer_lab.evaluation.pictures.scene import ClipActor, check_look
from wayfarer_lab.evaluation.pictures.sources import (
    caption,
    cut,
    random_runs,
    read_files,
    recorded,
)
from wayfarer_lab.evaluation.pictures.stills import Watch, contact_sheet, strip
from wayfarer_lab.evaluation.pictures.top import top_view

SIZES: Final = {"strip": 260, "sheet": 180, "top": 900, "film": 480, "crowd": 480}
"""Default pixels of each kind."""

SECONDS_PER_GOAL: Final = 12.0
"""Seconds after which a random run ends: 60 primitives, as in the paper (Sec. 4.2)."""


def render(
    sources: Annotated[
        list[Path] | None, typer.Argument(metavar="CLIP", help="Clips to draw: .npz or .glb.")
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Picture (.png) or film (.gif, .mp4) to write.")
    ] = Path("render.png"),
    kind: Annotated[
        str | None,
        typer.Option(
            help="strip (one clip; default of .png), sheet (a row each; default of .png for "
            "several), top (from above), film (camera follows; default of .gif and .mp4), crowd "
            "(all on one floor)."
        ),
    ] = None,
    goals: Annotated[
        int, typer.Option(help="Also make this many random runs to goals.", min=0)
    ] = 0,
    stops: Annotated[int, typer.Option(help="Goals per random run, visited in turn.", min=1)] = 1,
    seed: Annotated[int, typer.Option(help="The same seed gives the same runs.", min=0)] = 0,
    model: Annotated[
        Path,
        typer.Option(help="Model folder for the random runs.", show_default="the shipped model"),
    ] = DEFAULT_MODEL,
    candidates: Annotated[
        int, typer.Option(help="Candidate primitives tried per step of the random runs.", min=1)
    ] = 1,
    threads: Annotated[int, typer.Option(help="Threads of the engine; 0: all cores.", min=0)] = 0,
    data: Annotated[
        Path | None, typer.Option(help="Folder made by `wayfarer data prepare`, for --clip.")
    ] = None,
    clip: Annotated[
        list[str] | None, typer.Option(help="Also draw this recording of --data; repeatable.")
    ] = None,
    start: Annotated[float, typer.Option(help="Second at which to begin.", min=0)] = 0.0,
    seconds: Annotated[
        float | None, typer.Option(help="Seconds to draw; without it, all.", min=0.025)
    ] = None,
    view: Annotated[
        str,
        typer.Option(help="quarter, side, front, back, or body (the side, turning with the body)."),
    ] = "quarter",
    look: Annotated[
        str | None,
        typer.Option(help="dressed (default of films), or sides (left red, right blue)."),
    ] = None,
    every: Annotated[int, typer.Option(help="Strip: frames between two bodies.", min=1)] = 8,
    columns: Annotated[int, typer.Option(help="Strip, sheet: bodies in a row.", min=1)] = 10,
    size: Annotated[
        int | None,
        typer.Option(help="Pixels: height of a film or cell, or side of a plan.", min=32),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(help="Pictures per second; without it, 20 for .gif and 40 for .mp4.", min=1),
    ] = None,
) -> None:
    """Draw motion, without display or GPU. For example:

    wayfarer render walk.npz -o strip.png

    wayfarer render --goals 20 --seed 7 -o sheet.png

    wayfarer render walk.npz --seconds 4 -o walk.gif
    """
    names = clip or []
    kind = choose_kind(out, kind, len(sources or []) + len(names) + goals)
    look = check_look(look or ("dressed" if kind in FILMS else "sides"))
    check_view(view)
    if bool(names) != (data is not None):
        raise InvalidArgument("--data DIR and --clip NAME go together: a recording in a folder")
    rate = film_rate(out, fps)
    if out.suffix.lower() == ".mp4":
        importlib.import_module("imageio_ffmpeg")  # before minutes of drawing, not after them

    clips = read_files(sources or [])
    if data is not None:
        clips |= recorded(data, names)
    if goals:
        limit = start + (seconds or SECONDS_PER_GOAL * stops)
        clips |= _runs(goals, seed, stops, limit, model, candidates, threads)
    clips = {name: cut(name, found, start, seconds) for name, found in clips.items()}
    if kind == "crowd" and (goals or names):
        # runs and recordings are nowhere in particular: they are brought together
        clips = dict(zip(clips, gathered(list(clips.values())), strict=True))

    actors = [
        ClipActor.of(found, load_body(found.body, found.gender), look, style)
        for style, found in enumerate(clips.values(), start=seed)
    ]
    size = size or SIZES[kind]
    if kind in FILMS:
        film = (
            crowd_film(actors, size, rate)
            if kind == "crowd"
            else follow_film(actors, list(clips), size, rate, view)
        )
        with _progress("drawing pictures") as watch:
            write_film(out, film, watch)
        megabytes = out.stat().st_size / 1e6
        typer.echo(f"{out}: {film.pictures} pictures, {film.seconds:.1f} s, {megabytes:.1f} MB")
    else:
        captions = [caption(name, found) for name, found in clips.items()]
        picture = _still(kind, actors, captions, view, size, every, columns)
        write_still(out, picture)
        seconds = sum(found.seconds for found in clips.values())
        typer.echo(f"{out}: {picture.width} × {picture.height} px, {seconds:.1f} s of motion")


def _still(
    kind: str,
    actors: list[ClipActor],
    captions: list[str],
    view: str,
    size: int,
    every: int,
    columns: int,
) -> Image.Image:
    if kind == "top":
        return top_view(actors, (size, size))
    with _progress("drawing bodies") as watch:
        if kind == "strip":
            return strip(actors[0], every, view, columns, size, watch)
        return contact_sheet(actors, captions, columns, view, size, watch)


def _runs(
    count: int,
    seed: int,
    stops: int,
    seconds: float,
    model: Path,
    candidates: int,
    threads: int,
) -> dict[str, Clip]:
    world = open_bundle(model, threads).world(1, Steering().with_search(candidates=candidates))
    with _progress("walking (runs)") as watch:
        made = random_runs(world, count, seed, stops, seconds, watch)
    return {f"run {number} of seed {seed}": clip for number, clip in enumerate(made)}


@contextmanager
def _progress(title: str) -> Iterator[Watch]:
    with report.progress() as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
