"""Tables of predictors and regressors whose answers are known."""

from pathlib import Path

import numpy as np
import pytest

from tests.evaluation.recordings import SPEED, write_recordings
from wayfarer.body.library import load_body
from wayfarer.errors import InvalidArgument
from wayfarer.evaluation import models
from wayfarer.evaluation.tracks import Recorded
from wayfarer.spec import FPS, GENDERS, POSED_JOINTS

NAMES = ("predictor_1f.onnx", "predictor_2f.onnx", "regressor_male.onnx", "regressor_female.onnx")


class KnowingSession:
    """Answers like a perfect network for T-poses that glide along Y at `SPEED`."""

    def __init__(self, path: Path) -> None:
        self.name = path.stem
        self.off = np.zeros(3, np.float32)  # error put into every regressed place

    def run(self, outputs: list[str], given: dict[str, np.ndarray]) -> list[np.ndarray]:
        if self.name.startswith("predictor"):
            seed = given["seed"]
            steps = np.arange(1, 11 - seed.shape[1], dtype=np.float32)
            move = np.tile(np.float32([0, SPEED / FPS, 0]), 67)
            return [seed[:, -1:] + steps[:, None] * move + 0 * given["latent"][:, :1, None]]
        body = load_body("anny52", self.name.removeprefix("regressor_"))
        rows = len(given["markers"])
        turns = np.tile(np.eye(3, dtype=np.float32), (rows, POSED_JOINTS, 1, 1))
        place = []
        for markers, betas in zip(given["markers"].reshape(-1, 67, 3), given["betas"], strict=True):
            rest = body.rest_joints(betas)
            upright = body.markers(betas, np.tile(np.eye(3), (len(rest), 1, 1)), rest - rest[0])
            place.append((markers - upright).mean(0) + self.off)
        return [np.float32(place), turns]


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    for name in NAMES:
        (tmp_path / name).touch()
    return Recorded(write_recordings(tmp_path), "heldout")


@pytest.fixture(autouse=True)
def perfect(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "_open", KnowingSession)
    monkeypatch.setattr(models, "MESH_FRAMES", 3)  # a whole mesh takes a while


def test_predictors_stand_beside_the_simplest_guesses(recorded: Recorded, tmp_path: Path) -> None:
    rows = {row["name"]: row for row in models.predictor_rows(tmp_path, recorded, 3, 50, 0)}
    assert list(rows) == [
        "1f, best of 3", "1f, one sample", "2f, best of 3", "2f, one sample",
        "repeat last frame", "straight line",
    ]  # fmt: skip
    for name in ("1f, best of 3", "2f, one sample", "straight line"):
        assert rows[name]["ade_m"] == pytest.approx(0.0, abs=1e-4)
    assert rows["2f, best of 3"]["apd_m"] == pytest.approx(0.0, abs=1e-5)
    step = np.sqrt(67) * SPEED / FPS  # metres that a flattened pose moves in a frame
    assert rows["repeat last frame"]["ade_m"] == pytest.approx(step * 4.5, rel=1e-3)
    assert rows["repeat last frame"]["fde_m"] == pytest.approx(step * 8, rel=1e-3)
    assert rows["straight line"]["primitives"] == 2 * 50


def test_a_folder_without_predictors_is_refused(recorded: Recorded, tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match=r"predictor_1f\.onnx"):
        models.predictor_rows(tmp_path / "elsewhere", recorded, 3, 5, 0)


def test_perfect_regressors_have_no_error(recorded: Recorded, tmp_path: Path) -> None:
    rows = models.regressor_rows(tmp_path, recorded, 5, 0)
    names = [f"{g}, {s} shapes" for g in GENDERS for s in ("recorded", "random")]
    assert [row["name"] for row in rows] == names
    for row in rows:
        assert row["amd_mm"] == pytest.approx(0.0, abs=0.01)
        assert row["avd_mm"] == pytest.approx(0.0, abs=0.01)
        assert row["joint_angle_deg"] == pytest.approx(0.0, abs=0.1)


def test_an_error_of_known_size_is_found_in_millimetres(
    recorded: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def off_by_5mm(path: Path) -> KnowingSession:
        session = KnowingSession(path)
        session.off = np.float32([0.003, 0.0, 0.004])
        return session

    monkeypatch.setattr(models, "_open", off_by_5mm)
    for row in models.regressor_rows(tmp_path, recorded, 5, 0):
        assert row["amd_mm"] == pytest.approx(5.0, abs=0.01)
        assert row["amd_p95_mm"] == pytest.approx(5.0, abs=0.01)
        assert row["avd_mm"] == pytest.approx(5.0, abs=0.01)
