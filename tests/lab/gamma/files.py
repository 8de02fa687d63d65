"""A user's folder, made up: checkpoints of GAMMA-release's shapes, SMPL-X, MOJO's markers."""

import json
from pathlib import Path

import numpy as np
import torch

from tests.body.smplx_files import smplx_arrays
from tests.lab.gamma import release
from wayfarer.body.library import load_body
from wayfarer_lab.gamma.models import Checkpoints

SSM2 = (
    *("C7", "CLAV", "LANK", "LFWT", "LBAK", "LBCEP", "LBSH", "LBUM", "LBUST"),
    *("LCHEECK", "LELB", "LELBIN", "LFIN", "LFRM2", "LFTHI", "LFTHIIN", "LHEE", "LIWR"),
    *("LKNE", "LKNI", "LMT1", "LMT5", "LNWST", "LOWR", "LBWT", "LRSTBEEF", "LSHO"),
    *("LTHI", "LTHMB", "LTIB", "LTOE", "MBLLY", "RANK", "RFWT", "RBAK", "RBCEP"),
    *("RBSH", "RBUM", "RBUSTLO", "RCHEECK", "RELB", "RELBIN", "RFIN", "RFRM2", "RFRM2IN"),
    *("RFTHI", "RFTHIIN", "RHEE", "RKNE", "RKNI", "RMT1", "RMT5", "RNWST", "ROWR"),
    *("RBWT", "RRSTBEEF", "RSHO", "RTHI", "RTHMB", "RTIB", "RTOE", "STRN", "T8"),
    *("LFHD", "LBHD", "RFHD", "RBHD"),
)
"""Names and order of MOJO's set of 67 markers. Its vertices are not given here."""


def write_body(folder: Path, pose_blend: float = 1.0) -> None:
    """SMPLX_{MALE,FEMALE}.npz and markers.json, markers where ours have the same name."""
    arrays, body = smplx_arrays(), load_body("anny52", "female", "low")
    arrays["posedirs"] = pose_blend * arrays["posedirs"]
    ours = dict(zip(body.marker_names, body.marker_vertices.tolist(), strict=True))
    others = iter(np.random.default_rng(1).integers(0, len(arrays["v_template"]), 67).tolist())
    indices = {name: ours.get(name, next(others)) for name in SSM2}
    for gender in ("MALE", "FEMALE"):
        np.savez(folder / f"SMPLX_{gender}.npz", **arrays)
    table = {"markersets": [{"distance_from_skin": 0.0095, "indices": indices, "type": "body"}]}
    (folder / "markers.json").write_text(json.dumps(table))


def write_checkpoints(folder: Path) -> Checkpoints:
    torch.manual_seed(5)
    regressor = release.Regressor()
    regressor.pnet.out_fc.weight.data *= 0.1  # bodies near the T-pose
    regressor.pnet.out_fc.bias.data[3:135] += torch.tensor([1.0, 0, 0, 1, 0, 0]).repeat(22) / 3
    models = {
        "predictor_1f": release.Predictor(),
        "predictor_2f": release.Predictor(),
        "policy": release.Policy(),
        "regressor_male": regressor,
        "regressor_female": regressor,
    }
    return Checkpoints(**{n: release.save(folder / f"{n}.ckp", m) for n, m in models.items()})
