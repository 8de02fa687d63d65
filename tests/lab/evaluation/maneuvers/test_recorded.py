"""Activities are recognised by the body's motion."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.lab.evaluation.maneuvers.bodies import take, time
from tests.lab.evaluation.recordings import write_recordings
from wayfarer.errors import DataError, InvalidArgument
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.maneuvers import recorded
from wayfarer_lab.evaluation.maneuvers.likeness import LIKENESS
from wayfarer_lab.evaluation.maneuvers.stop import STOP
from wayfarer_lab.evaluation.maneuvers.strafe import STRAFE
from wayfarer_lab.evaluation.maneuvers.walk import WALK
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.training.mocap.selection import Use
from wayfarer_lab.training.mocap.store import Dataset


def used(made: Take, use: int = Use.LOCOMOTION) -> np.ndarray:
    return np.full(len(made), use, np.uint8)


@pytest.mark.parametrize(
    ("x", "y", "heading", "case"),
    [(-0.6, 0, 0, "left"), (0.6, 0, 0, "right"), (0, -0.6, 0, "back"), (0.6, 0, 180, "left")],
)
def test_strafes_are_told_by_the_way_against_the_facing(
    x: float, y: float, heading: float, case: str
) -> None:
    made = take(4.0, x=x * time(4.0), y=y * time(4.0), heading=heading)
    [(found, part)] = recorded.strafes(made, used(made))
    assert found == case and len(part) >= 3.5 * FPS
    assert not list(recorded.strafes(made, used(made, Use.EXCLUDED)))


def test_forward_walks_and_stands_are_no_strafes() -> None:
    for made in (take(4.0, y=0.8 * time(4.0)), take(4.0)):
        assert not list(recorded.strafes(made, used(made)))


def test_straight_walks_come_with_their_speed() -> None:
    made = take(6.0, y=1.3 * time(6.0))
    [(speed, part)] = recorded.straight(made, used(made))
    assert speed == pytest.approx(1.3, abs=0.01) and len(part) > 5 * FPS
    curve = take(6.0, x=np.cos(time(6.0)), y=1.3 * np.sin(time(6.0)), heading=60 * time(6.0))
    assert not list(recorded.straight(curve, used(curve)))
    faster = take(6.0, y=0.5 * time(6.0) ** 2)
    assert not list(recorded.straight(faster, used(faster)))


def test_turns_are_of_the_feet_and_on_the_spot() -> None:
    turned = 90 * np.clip((time(5.0) - 2) / 1.5, 0, 1)
    made = take(5.0, heading=turned)
    [(case, part)] = recorded.turns(made, used(made))
    assert case == "90°" and np.ptp(part.heading) == pytest.approx(90, abs=10)
    walked = take(5.0, heading=turned, y=1.0 * time(5.0))
    assert not list(recorded.turns(walked, used(walked)))
    legs = {f"{side}_hip": (0.0, 0.0, -turned) for side in ("left", "right")}
    twist = take(5.0, heading=turned, **legs)
    assert not list(recorded.turns(twist, used(twist))), "the feet stay"


def test_stops_end_walks() -> None:
    made = take(7.0, y=np.minimum(time(7.0), 3.0))
    [(case, part)] = recorded.stops(made, used(made))
    assert case == STOP.cases[0].name and part.hips[-1, 1] == pytest.approx(3.0)
    assert not list(recorded.stops(*_with_use(take(7.0)))), "nobody walked"


def test_a_folder_gives_takes_of_one_gender_by_case_and_split(tmp_path: Path) -> None:
    recordings = recorded.RecordedClips(write_recordings(tmp_path, "heldout", "train"))
    found = recordings(WALK)
    assert set(found) == {
        ("1.1-1.5 m/s", recorded.RECORDED), ("1.1-1.5 m/s", recorded.HELDOUT)
    }  # fmt: skip
    takes = [shot.take for shot in found["1.1-1.5 m/s", recorded.RECORDED]]
    assert len(takes) == 2 and {t.clip.gender for t in takes} == {recorded.GENDER}
    assert len(found["1.1-1.5 m/s", recorded.HELDOUT]) == 1
    assert recordings(STRAFE) == {} and len(recordings(LIKENESS)) == 2


def test_acted_styles_are_left_out_where_there_is_enough_without(tmp_path: Path) -> None:
    folder = write_recordings(tmp_path, "train")
    data = Dataset.load(folder)
    for style, takes in (("Chicken", 0), ("Neutral", 1)):
        clips = tuple(replace(clip, name=f"{style}_FW") for clip in data.clips)
        replace(data, clips=clips).save(folder)
        assert len(recorded.RecordedClips(folder)(WALK)) == takes
    assert recorded.person_of(clips[0]) == "07 Neutral"


def test_a_folder_without_recordings_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError):
        recorded.RecordedClips(tmp_path)
    data = Dataset.load(write_recordings(tmp_path, "train"))
    replace(data, clips=tuple(replace(c, augmentation="warp") for c in data.clips)).save(tmp_path)
    with pytest.raises(InvalidArgument, match="no male clips"):
        recorded.RecordedClips(tmp_path)


def _with_use(made: Take) -> tuple[Take, np.ndarray]:
    return made, used(made)
