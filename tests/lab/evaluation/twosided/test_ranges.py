"""Ranges of recordings."""

from pathlib import Path

import numpy as np
import pytest

from tests.lab.evaluation.recordings import write_recordings
from wayfarer.errors import DataError
from wayfarer_lab.evaluation.maneuvers.recorded import RecordedClips
from wayfarer_lab.evaluation.twosided import ranges
from wayfarer_lab.evaluation.twosided.ranges import Stretch, ranges_of
from wayfarer_lab.evaluation.twosided.situations import REPORTED, SITUATIONS


def stretch(person: str, sway: float) -> Stretch:
    return Stretch("stand", person, "clip", {"sway_cm": sway})


def test_a_range_goes_from_the_10th_to_the_90th_percentile() -> None:
    found = ranges_of([stretch(f"{k}", k) for k in range(101)])["stand"]["sway_cm"]
    assert (found.low, found.middle, found.high) == pytest.approx((10, 50, 90), abs=0.6)
    assert found.stretches == found.performers == 101


def test_a_performer_counts_once_however_often_it_is_recorded() -> None:
    often = [stretch("often", 0.0)] * 97
    rare = [stretch(f"{k}", 5.0 + k) for k in range(9)]
    found = ranges_of(often + rare)["stand"]["sway_cm"]
    assert found.middle > 5 and found.performers == 10


def test_few_stretches_make_no_range_and_literature_does() -> None:
    found = ranges_of([stretch("a", 1.0)] * 3)["stand"]
    assert "sway_cm" not in found and found["shifts_min"].stretches == 0


def test_equal_weights_give_the_usual_quantiles() -> None:
    values = np.random.default_rng(0).normal(size=50)
    found = ranges.quantiles(values, np.ones(50), (0.1, 0.5, 0.9))
    assert found == pytest.approx(np.quantile(values, (0.1, 0.5, 0.9), method="hazen"))


def test_recordings_are_measured_and_the_file_is_read_back(tmp_path: Path) -> None:
    clips = RecordedClips(write_recordings(tmp_path, "train", "heldout"))
    found = ranges.measure(clips)
    walks = [s for s in found if s.situation.startswith("walk")]
    assert walks and {s.performer for s in walks} == {"07"}
    assert 1.0 < walks[0].values["speed_mps"] < 1.6
    made = ranges_of(found * 4)
    ranges.save(made, {}, tmp_path / "ranges.json")
    again = ranges.load(tmp_path / "ranges.json")
    assert set(again) == set(SITUATIONS)
    kept = again[walks[0].situation]["arm_out_deg"]
    assert kept.low == pytest.approx(made[walks[0].situation]["arm_out_deg"].low, rel=1e-3)


def test_the_shipped_ranges_cover_every_situation() -> None:
    shipped = ranges.load()
    assert set(shipped) == set(SITUATIONS)
    for name, row in shipped.items():
        recorded = any(r.stretches >= ranges.MIN_STRETCHES for r in row.values())
        assert recorded or name.startswith("stairs"), name
        assert all(r.low <= r.middle <= r.high for r in row.values())
        assert set(row) - REPORTED


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"format": 0}')
    with pytest.raises(DataError, match="wayfarer eval ranges"):
        ranges.load(tmp_path / "a.json")
