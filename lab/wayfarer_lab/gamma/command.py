"""`wayfarer import gamma`."""

import os
from pathlib import Path
from typing import Annotated

import typer

from wayfarer.body.library import SMPLX_FOLDER
from wayfarer.motion.primitive import GROUNDING
from wayfarer_lab.gamma.models import Checkpoints, import_gamma
from wayfarer_lab.gamma.networks import PASSES

File = typer.Option(exists=True, dir_okay=False)


def gamma(
    predictor_1f: Annotated[Path, File],
    predictor_2f: Annotated[Path, File],
    policy: Annotated[Path, File],
    regressor_male: Annotated[Path, File],
    regressor_female: Annotated[Path, File],
    smpl_models: Annotated[
        Path,
        typer.Option(
            envvar=SMPLX_FOLDER,
            exists=True,
            file_okay=False,
            help="Folder of your own SMPLX_MALE.npz and SMPLX_FEMALE.npz, with MOJO's SSM2.json as "
            "markers.json.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Model folder to write.")] = Path("gamma-release"),
    passes: Annotated[
        int, typer.Option(min=1, help="Passes of the regressors: n_recur of their configuration.")
    ] = PASSES,
    grounding: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1.0,
            help="Share of a primitive's height error that is taken off. 0: none, as in the paper; "
            "bodies float off or sink over minutes.",
        ),
    ] = GROUNDING,
) -> None:
    """Write the checkpoints of GAMMA-release, the paper's own code, as a model folder.

    Checkpoints and SMPL-X are not ours to give: docs/models.md says where to get them. They are
    read without running any code that they may hold. The command fails unless the written graphs
    agree with the imported networks. For example:

    wayfarer import gamma --smpl-models SMPLX --predictor-1f MPVAE_1frame_v4/epoch-300.ckp
    --predictor-2f MPVAE_2frame_v4/epoch-300.ckp --policy MPVAEPolicy_v0/epoch-500.ckp
    --regressor-male MoshRegressor_v3_male/epoch-100.ckp
    --regressor-female MoshRegressor_v3_female/epoch-100.ckp
    """
    os.environ[SMPLX_FOLDER] = str(smpl_models)  # where the body library looks
    files = Checkpoints(predictor_1f, predictor_2f, policy, regressor_male, regressor_female)
    for file, difference in import_gamma(files, out, passes, grounding).items():
        typer.echo(f"{file}: torch and ONNX differ by at most {difference:.1e}")
    typer.echo(f"{out}: written")
