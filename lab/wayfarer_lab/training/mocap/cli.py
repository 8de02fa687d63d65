"""`wayfarer data prepare`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from wayfarer.body.library import SMPLX_FOLDER, load_body
from wayfarer.spec import GENDERS
from wayfarer_lab.training.mocap.fit import FitOptions
from wayfarer_lab.training.mocap.load import ReadOptions
from wayfarer_lab.training.mocap.prepare import PrepareOptions
from wayfarer_lab.training.mocap.prepare import prepare as run_prepare
from wayfarer_lab.training.mocap.report import write_report

app = typer.Typer(help="Prepare motion capture for training.")

_Names = Annotated[str, typer.Option(help="Comma-separated.")]


@app.command()
def prepare(
    src: Annotated[
        Path,
        typer.Argument(
            help="Folder of BVH, FBX, ASF/AMC or AMASS files (.npz), optionally with index.csv."
        ),
    ],
    dst: Annotated[
        Path, typer.Argument(help="Folder for the prepared data; an earlier run is resumed.")
    ],
    index: Annotated[
        list[Path] | None,
        typer.Option(help="Index table (CSV); repeatable. Default: SRC/index.csv."),
    ] = None,
    validation: Annotated[
        str, typer.Option(help="Subjects and clips to hold back for validation, comma-separated.")
    ] = "",
    shapes: Annotated[int, typer.Option(min=1, help="Shapes per gender and locomotion clip.")] = 2,
    other_shapes: Annotated[int, typer.Option(min=0, help="Shapes per other clip.")] = 1,
    acted: Annotated[
        str,
        typer.Option(
            help="Clips whose acted upper bodies become plain ones, e.g. 'Chicken_*,Drunk_*'."
        ),
    ] = "",
    clips: Annotated[str, typer.Option(help="Only these clips, comma-separated.")] = "",
    fps: Annotated[
        float, typer.Option(help="Frame rate of AMC files, which do not state it.")
    ] = 120.0,
    unit: Annotated[
        float | None,
        typer.Option(
            help="Metres per unit of a BVH or FBX file. Default: from the length of the legs."
        ),
    ] = None,
    up: Annotated[
        str | None,
        typer.Option(
            help="Upward axis of BVH, AMC and FBX files, y or z. Default: the one along which "
            "their zero pose stands, y if it stands along neither."
        ),
    ] = None,
    reference: Annotated[
        str,
        typer.Option(
            help="FRAME or CLIP:FRAME (from 0) in which the person stands: the rest pose of files "
            "whose zero pose does not stand. Default: the best standing frame, which is reported.",
        ),
    ] = "",
    bvh_fix: Annotated[
        bool, typer.Option(help="Mend CMU's BVH conversion (lost thorax and wrist bones).")
    ] = True,
    smpl_models: Annotated[
        Path | None,
        typer.Option(
            envvar=SMPLX_FOLDER,
            help="AMASS: folder of your own body models, SMPLX_MALE.npz ... for files of SMPL-X, "
            "smplh/male/model.npz ... for files of SMPL+H.",
            show_default="none",
        ),
    ] = None,
    steps: Annotated[
        int, typer.Option(min=1, help="Optimisation steps of the fit.")
    ] = FitOptions.steps,
    device: Annotated[str, typer.Option(help="Where to fit: cpu or cuda.")] = "cpu",
    workers: Annotated[int, typer.Option(min=1, help="Worker processes.")] = 1,
    seed: Annotated[int, typer.Option(help="Seed of random shapes.")] = 0,
) -> None:
    """Read recordings, mend them, fit them to the body, and select what training uses.

    Writes motion.npz and a report. After Ctrl-C the same command resumes. docs/data.md explains
    every step.
    """
    if up not in (None, "y", "z"):
        raise typer.BadParameter(f"up must be y or z, got '{up}'")
    bodies = {gender: load_body("anny52", gender) for gender in GENDERS}
    console = Console(stderr=True)
    options = PrepareOptions(
        index=tuple(index or ()),
        read=ReadOptions(fps, unit, up, bvh_fix, smpl_models, reference),
        fit=FitOptions(steps=steps, device=device),
        validation=_names(validation),
        shapes=shapes,
        other_shapes=other_shapes,
        acted=_names(acted),
        clips=_names(clips),
        seed=seed,
        workers=workers,
    )
    done = run_prepare(src, dst, bodies, options, console)
    write_report(dst, done.dataset, done.fits, done.skipped, done.notes, bodies)
    console.print(f"wrote {dst / 'motion.npz'} and {dst / 'report.md'}", highlight=False)


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())
