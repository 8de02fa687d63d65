import io

import numpy as np
import pytest
from rich.console import Console

from tests.lab.training.mocap.synthetic import (
    amass_arrays,
    bvh_text,
    standing_rows,
    write_amass,
    write_smpl,
)
from wayfarer.body.library import load_body
from wayfarer.errors import DataError
from wayfarer_lab.training.mocap import fitting
from wayfarer_lab.training.mocap.fit import FitOptions
from wayfarer_lab.training.mocap.load import ReadOptions
from wayfarer_lab.training.mocap.prepare import PrepareOptions, prepare
from wayfarer_lab.training.mocap.report import write_report
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import Dataset

OPTIONS = PrepareOptions(fit=FitOptions(steps=5), shapes=1)


@pytest.fixture(scope="module")
def bodies():
    return {gender: load_body("anny52", gender) for gender in ("male", "female")}


@pytest.fixture
def src(tmp_path):
    folder = tmp_path / "src"
    folder.mkdir()
    (folder / "01_01.bvh").write_text(bvh_text(standing_rows(200)))
    (folder / "02_01.bvh").write_text(bvh_text(standing_rows(150), newline="\r\n"))
    (folder / "02_02.bvh").write_text(bvh_text(standing_rows(150)).replace("MOTION", "NOTION"))
    (folder / "02_03.amc").write_text("1\n")
    return folder


def quietly() -> Console:
    return Console(file=io.StringIO(), width=300)


def test_good_files_are_prepared_and_bad_ones_named(src, tmp_path, bodies) -> None:
    console = quietly()
    options = PrepareOptions(**{**vars(OPTIONS), "validation": ("02",)})
    done = prepare(src, tmp_path / "dst", bodies, options, console)
    data = Dataset.load(tmp_path / "dst")
    assert {(c.name, c.split, c.gender) for c in data.clips} == {
        (name, split, gender)
        for name, split in (("01_01", "train"), ("02_01", "validation"))
        for gender in bodies
    }
    assert len(done.skipped) == 2
    bad_line = bvh_text(standing_rows(150)).split("\n").index("MOTION") + 1
    assert f"02_02.bvh:{bad_line}: expected MOTION" in done.skipped[0] + done.skipped[1]
    assert "02_03.amc" in done.skipped[0] + done.skipped[1]
    assert console.file.getvalue().count("skipped") == 2
    # 200 frames at 120 without the first 10 are 64 at 40
    assert {c.stop - c.start for c in data.clips if c.name == "01_01"} == {64}
    assert (data.use == Use.STANDING).mean() > 0.9
    assert data.contacts.mean() > 0.95
    write_report(tmp_path / "dst", data, done.fits, done.skipped, done.notes, bodies)
    text = (tmp_path / "dst" / "report.md").read_text()
    assert "02_02.bvh" in text
    assert "train locomotion as recorded" in text
    assert (tmp_path / "dst" / "report.png").stat().st_size > 1000


def test_a_second_run_fits_nothing_and_gives_the_same(src, tmp_path, bodies, monkeypatch) -> None:
    first = prepare(src, tmp_path / "dst", bodies, OPTIONS, quietly()).dataset

    def refuse(*_: object) -> int:
        raise AssertionError("fitted again")

    monkeypatch.setattr(fitting, "fit_batch", refuse)
    again = prepare(src, tmp_path / "dst", bodies, OPTIONS, quietly()).dataset
    np.testing.assert_array_equal(first.rotations, again.rotations)
    changed = PrepareOptions(**{**vars(OPTIONS), "fit": FitOptions(steps=6)})
    with pytest.raises(AssertionError, match="fitted again"):
        prepare(src, tmp_path / "dst", bodies, changed, quietly())


def test_an_interrupted_run_goes_on_where_it_was(src, tmp_path, bodies, monkeypatch) -> None:
    real, calls = fitting.fit_batch, []

    def interrupted(*args: object) -> int:
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*args)

    monkeypatch.setattr(fitting, "fit_batch", interrupted)
    with pytest.raises(KeyboardInterrupt):
        prepare(src, tmp_path / "dst", bodies, OPTIONS, quietly())
    assert not (tmp_path / "dst" / "motion.npz").exists()
    prepare(src, tmp_path / "dst", bodies, OPTIONS, quietly())
    assert len(calls) == 3  # two genders: one batch before, one after the interruption


def test_amass_is_prepared_like_any_other_recording(tmp_path, bodies) -> None:
    src, models = tmp_path / "src", tmp_path / "models"
    write_amass(src / "KIT" / "3" / "stand_poses.npz", amass_arrays("smplh", 200, 100.0))
    write_amass(src / "KIT" / "3" / "shape.npz", {"betas": np.zeros(16)})
    write_amass(src / "SSM" / "ann" / "stand_stageii.npz", amass_arrays("smplx", 120, 60.0))
    write_amass(src / "SSM" / "ann" / "broken_stageii.npz", {"poses": np.zeros((4, 165))})
    for layout in ("smplh", "smplx"):
        write_smpl(models, layout, "male")
    options = PrepareOptions(
        read=ReadOptions(smpl_models=models), fit=FitOptions(steps=5), shapes=1,
        validation=("SSM/ann",),
    )  # fmt: skip
    done = prepare(src, tmp_path / "dst", bodies, options, quietly())
    clips = Dataset.load(tmp_path / "dst").clips
    assert {(c.name, c.subject, c.split) for c in clips} == {
        ("KIT/3/stand", "KIT/3", "train"),
        ("SSM/ann/stand", "SSM/ann", "validation"),
    }
    assert (done.dataset.use == Use.STANDING).mean() > 0.9
    assert done.dataset.contacts.mean() > 0.95
    height = done.dataset.translation[:, 2]
    assert 0.8 < height.min() <= height.max() < 1.2
    assert len(done.skipped) == 1
    assert "broken_stageii.npz: array trans is missing" in done.skipped[0]


def test_nothing_usable_and_unknown_subjects_are_errors(src, tmp_path, bodies) -> None:
    with pytest.raises(DataError, match="no usable motion"):
        options = PrepareOptions(**{**vars(OPTIONS), "clips": ("02_02",)})
        prepare(src, tmp_path / "dst", bodies, options, quietly())
    with pytest.raises(DataError, match="no such validation subject or clip: 99"):
        options = PrepareOptions(**{**vars(OPTIONS), "validation": ("99",)})
        prepare(src, tmp_path / "dst", bodies, options, quietly())
