"""Recorded motion as markers, and seeds taken from it."""

from pathlib import Path

import numpy as np
import pytest

from tests.lab.evaluation.recordings import FRAMES, SPEED, write_recordings
from wayfarer.errors import DataError, InvalidArgument
from wayfarer.spec import FPS
from wayfarer.world.agents.slots import Mode
from wayfarer_lab.evaluation.gait import gait_row
from wayfarer_lab.evaluation.realism import JudgedMotion
from wayfarer_lab.evaluation.seeds import walking_seeds
from wayfarer_lab.evaluation.tasks import random_specs
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


def test_walking_seeds_stand_on_the_floor_in_the_agents_own_shape(recorded: Recorded) -> None:
    random = np.random.default_rng(0)
    specs = random_specs(6, random)
    for spec, motion in zip(specs, walking_seeds(recorded, specs, random), strict=True):
        soles = motion.seed.markers[0][:, recorded.bodies[spec.gender].sole_markers]
        assert soles[..., 2].min() == pytest.approx(0.0, abs=1e-3)
        assert motion.seed.translation[0, -1, :2] == pytest.approx(spec.position, abs=1e-5)
        assert motion.gait.mode[0] == Mode.WALKING
        assert motion.gait.speed[0] == pytest.approx(SPEED, abs=1e-2)
    shapes = {m.seed.markers[0, 0, 0, 2] for m in walking_seeds(recorded, specs, random)}
    assert len(shapes) == len(specs), "each agent has a body of its own"


def test_recordings_without_walking_give_no_seeds(recorded: Recorded) -> None:
    recorded.data.use[:] = Use.OTHER
    with pytest.raises(InvalidArgument, match="no walking"):
        walking_seeds(recorded, random_specs(1, np.random.default_rng(0)), np.random.default_rng(0))
