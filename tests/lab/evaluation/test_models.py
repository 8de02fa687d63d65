"""Tables of predictors and regressors whose answers are known."""

from pathlib import Path

import numpy as np
import pytest
import torch

from tests.lab.evaluation.fakes import known_parts
from tests.lab.evaluation.recordings import SPEED, write_recordings
from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS, GENDERS
from wayfarer_lab.evaluation import models
from wayfarer_lab.evaluation.tracks import Recorded


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    return Recorded(write_recordings(tmp_path), "heldout")


@pytest.fixture(autouse=True)
def few_meshes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "MESH_FRAMES", 3)  # a whole mesh takes a while


def test_predictors_stand_beside_the_simplest_guesses(recorded: Recorded) -> None:
    made = models.predictor_rows(known_parts(), recorded, 3, 50, 0, memory=recorded)
    rows = {row["name"]: row for row in made}
    assert list(rows) == [
        "ro-1f", "ro-1f, one sample", "ro-2f", "ro-2f, one sample",
        "repeat last frame", "straight line", "mocap",
    ]  # fmt: skip
    for name in ("ro-1f", "ro-2f, one sample", "straight line", "mocap"):
        assert rows[name]["ade_m"] == pytest.approx(0.0, abs=1e-4)
    assert rows["ro-2f"]["apd_m"] == pytest.approx(0.0, abs=1e-5)
    step = np.sqrt(67) * SPEED / FPS  # metres that a flattened pose moves in a frame
    assert rows["repeat last frame"]["ade_m"] == pytest.approx(step * 4.5, rel=1e-3)
    assert rows["repeat last frame"]["fde_m"] == pytest.approx(step * 8, rel=1e-3)
    assert rows["straight line"]["primitives"] == 2 * 50
    assert rows["ro-1f"]["samples"] == 3


def test_a_memory_of_other_motion_guesses_wrong(recorded: Recorded, tmp_path: Path) -> None:
    folder = write_recordings(tmp_path / "still", "heldout")
    still = Recorded(folder, "heldout")
    still.data.translation[:, 1] = 0.0  # they stand where the others glide
    rows = models.predictor_rows(known_parts(), recorded, 2, 20, 0, memory=still)
    assert rows[-1]["name"] == "mocap" and rows[-1]["ade_m"] > 0.5


def test_parts_without_predictors_are_refused(recorded: Recorded) -> None:
    with pytest.raises(InvalidArgument, match=r"predictor_1f\.onnx"):
        models.predictor_rows(known_parts(predictors={}), recorded, 3, 5, 0)


def test_a_split_without_primitives_is_refused(recorded: Recorded) -> None:
    recorded.data.use[:] = 0
    with pytest.raises(InvalidArgument, match="in use"):
        models.predictor_rows(known_parts(), recorded, 3, 5, 0)


def test_perfect_regressors_have_no_error(recorded: Recorded) -> None:
    rows = models.regressor_rows(known_parts(), recorded, 5, 0)
    names = [f"{g}, {s} shapes" for g in GENDERS for s in ("recorded", "random")]
    assert [row["name"] for row in rows] == [*names, "mocap"]
    for row in rows:
        assert row["amd_mm"] == pytest.approx(0.0, abs=0.01)
        assert row["avd_mm"] == pytest.approx(0.0, abs=0.01)
        assert row["joint_angle_deg"] == pytest.approx(0.0, abs=0.1)


def test_an_error_of_known_size_is_found_in_millimetres(recorded: Recorded) -> None:
    parts = known_parts()
    for regressor in parts.regressors.values():
        regressor.off = torch.tensor([0.003, 0.0, 0.004])
    *rows, mocap = models.regressor_rows(parts, recorded, 5, 0)
    for row in rows:
        assert row["amd_mm"] == pytest.approx(5.0, abs=0.01)
        assert row["amd_p95_mm"] == pytest.approx(5.0, abs=0.01)
        assert row["avd_mm"] == pytest.approx(5.0, abs=0.01)
    assert mocap["amd_mm"] == pytest.approx(0.0, abs=0.01)


def test_joint_angles_are_in_degrees(recorded: Recorded) -> None:
    poses = models.primitives(recorded, "male", 3, 0)
    turned = poses.rotations.clone()
    angle = torch.deg2rad(torch.tensor(30.0))
    c, s = torch.cos(angle), torch.sin(angle)
    turned[:, :, 1:] = torch.tensor([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    made = models.Primitives(poses.translation, turned, poses.betas)
    body = recorded.bodies["male"]
    row = models.differences("x", made, poses, body, models.load_marker_bodies()["male"])
    assert row["joint_angle_deg"] == pytest.approx(30.0, abs=1e-3)


def test_canonical_primitives_begin_over_the_origin_and_face_forward(recorded: Recorded) -> None:
    poses = models.primitives(recorded, "female", 4, 0)
    quarter = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    rotations = poses.rotations.clone()
    rotations[:, :, 0] = quarter @ rotations[:, :, 0]
    turned = models.Primitives(
        poses.translation @ quarter.T + torch.tensor([4.0, -2.0, 0.0]), rotations, poses.betas
    ).canonical()
    assert torch.allclose(turned.translation[:, 0, :2], torch.zeros(4, 2), atol=1e-5)
    assert torch.allclose(turned.translation, poses.canonical().translation, atol=1e-5)
    assert torch.allclose(turned.rotations, poses.canonical().rotations, atol=1e-5)
