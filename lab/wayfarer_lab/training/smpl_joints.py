"""Where SMPL bodies have their joints: from a user's own SMPL-X or SMPL+H model files.

The model files are licensed by the Max Planck Institute and are not shipped. Only their
arrays that place joints are read: `v_template`, `shapedirs` and `J_regressor` (Loper et al. 2015,
Eq. 8 and 10).
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final, Literal

import numpy as np

from wayfarer.body.library import SMPLX_FOLDER
from wayfarer.body.smplx import read_archive, read_array
from wayfarer.errors import ArtifactError
from wayfarer.spec import POSED_JOINTS
from wayfarer_lab.training.mocap.skeleton import Array

Layout = Literal["smplx", "smplh"]

JOINTS_OF: Final = {"smplx": 55, "smplh": 52}
"""Joints of a layout; the first 22 are ours, in our order."""

PLACES: Final = {
    "smplx": ("SMPLX_{upper}.npz", "smplx/SMPLX_{upper}.npz"),
    "smplh": ("{gender}/model.npz", "smplh/{gender}/model.npz", "SMPLH_{upper}.npz"),
}
"""Where the files lie in a user's folder: as the downloads unpack, or beside each other."""


@dataclass(frozen=True)
class SmplJoints:
    """Joints of one gendered body in the file's axes: Y up, facing +Z, left is +X; metres."""

    mean: Array  # [22, 3]
    dirs: Array  # [22, 3, B] by shape coefficient

    def rest(self, betas: Array) -> Array:
        """Joints [22, 3] of a shape's zero pose; coefficients that the file lacks are left out."""
        known = min(len(betas), self.dirs.shape[-1])
        return self.mean + self.dirs[..., :known] @ np.asarray(betas, float)[:known]


def find_model(folder: Path | None, layout: Layout, gender: str) -> Path:
    """A model file in a user's folder. Raises ArtifactError, which lists the places it was sought.

    Without a folder that is said, too.
    """
    names = [p.format(gender=gender, upper=gender.upper()) for p in PLACES[layout]]
    if folder is None:
        raise ArtifactError(
            f"SMPL parameters need the body model that they belong to, your own {names[0]}: "
            f"give its folder (--smpl-models, or {SMPLX_FOLDER})"
        )
    for name in names:
        if (folder / name).is_file():
            return folder / name
    raise ArtifactError(f"{folder}: holds no {gender} {layout} body; expected {' or '.join(names)}")


@cache
def load_joints(path: Path, layout: Layout) -> SmplJoints:
    """The joints of a model file. Raises ArtifactError, which names the array and its shape."""
    file = read_archive(path)
    template = read_array(path, file, "v_template", ("V", 3))
    shapes = read_array(path, file, "shapedirs", (len(template), 3, "B"))
    regressor = read_array(path, file, "J_regressor", (JOINTS_OF[layout], len(template)))
    rows = regressor[:POSED_JOINTS]
    return SmplJoints(rows @ template, np.einsum("jv,vcb->jcb", rows, shapes))
