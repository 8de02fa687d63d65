"""Recorded motion as markers."""

from pathlib import Path

import pytest

from tests.lab.evaluation.recordings import FRAMES, SPEED, write_recordings
from wayfarer.errors import DataError, InvalidArgument
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.gait import gait_row
from wayfarer_lab.evaluation.realism import JudgedMotion
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.training.mocap.selection import Use


@pytest.fixture
def recorded(tmp_path: Path) -> Recorded:
    return Recorded(write_recordings(tmp_path), "heldout")


def test_only_clips_as_recorded_count(recorded: Recorded) -> None:
    assert [clip.name for clip in recorded.clips] == ["c0", "c1"]


def test_an_empty_split_names_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match="heldout"):
        Recorded(write_recordings(tmp_path), "validation")


def test_an_unprepared_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="wayfarer data prepare"):
        Recorded(tmp_path, "heldout")


def test_windows_hold_frames_in_use_only(recorded: Recorded) -> None:
    windows = recorded.windows(Use.LOCOMOTION)
    assert windows.markers.shape == ((FRAMES - 5) // FPS, FPS, 67, 3)
    assert recorded.windows(Use.STANDING).markers.shape == (0, FPS, 67, 3)


def test_a_clip_that_is_prepared_on_both_genders_counts_once(recorded: Recorded) -> None:
    assert {clip.gender for clip in recorded.clips} == {"male", "female"}
    assert len(recorded.once) == 1
    assert len(JudgedMotion.recorded(recorded).tracks) == 1


def test_recorded_gait_is_measured_on_the_skinned_body(recorded: Recorded) -> None:
    body = recorded.bodies["female"]
    row = gait_row("mocap", recorded.windows(Use.LOCOMOTION), body.sole_markers)
    assert row["speed_mps"] == pytest.approx(SPEED, abs=1e-4)
    assert row["slide_cm_s"] == pytest.approx(100 * SPEED, abs=0.1)
    assert row["penetration_cm"] == pytest.approx(0.0, abs=0.01)
    assert row["both_feet_skating"] == 1.0
