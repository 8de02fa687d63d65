from pathlib import Path

import numpy as np
import pytest

from tests.lab.evaluation.recordings import write_recordings
from tests.world.fakes import make_world
from wayfarer.clips.files import write_clip
from wayfarer.errors import DataError, InvalidArgument, NotFound
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation.pictures.sources import (
    caption,
    cut,
    random_runs,
    read_files,
    recorded,
)
from wayfarer_lab.training.mocap.store import Dataset


def test_files_are_named_by_their_paths(tmp_path, clip, body):
    write_clip(tmp_path / "a.npz", clip)
    (found,) = read_files([tmp_path / "a.npz"]).items()
    assert found[0] == str(tmp_path / "a.npz")
    np.testing.assert_allclose(found[1].translation, clip.translation, atol=1e-6)


def test_a_picture_given_as_a_clip_is_explained():
    with pytest.raises(InvalidArgument, match=r"--out strip\.png"):
        read_files([Path("strip.png")])


def test_recordings_are_found_by_name(tmp_path):
    folder = write_recordings(tmp_path)
    data = Dataset.load(folder)
    found = recorded(folder, ["c1", "c0"])
    assert list(found) == ["c1", "c0"]
    for name, clip in found.items():
        source = next(c for c in data.clips if c.name == name)
        assert clip.gender == source.gender
        expected = data.translation[source.start : source.stop]
        np.testing.assert_array_equal(clip.translation, expected)


def test_an_unknown_recording_names_the_nearest_and_a_wrong_folder_is_refused(tmp_path):
    with pytest.raises(DataError, match="wayfarer data prepare"):
        recorded(tmp_path, ["c1"])
    folder = write_recordings(tmp_path)
    with pytest.raises(NotFound, match="no clip 'c9'; the nearest: c"):
        recorded(folder, ["c9"])


def test_clips_are_cut_by_seconds(clip):
    part = cut("a", clip, 0.1, 0.2)
    np.testing.assert_array_equal(part.translation, clip.translation[4:12])
    assert part.goals == clip.goals
    assert cut("a", clip, 0.1, None).frames == 16
    with pytest.raises(InvalidArgument, match=r"0\.5 s long"):
        cut("a", clip, 0.5, None)


def runs(count, seed=0, **options):
    return random_runs(make_world(phases=1), count, seed, **options)


def test_people_go_to_their_goals_and_stand():
    made = runs(4)
    assert [clip.gender for clip in made] == list(GENDERS) * 2
    assert len({clip.betas for clip in made}) == 4
    for clip in made:
        (goal,) = clip.goals
        assert 2 <= np.hypot(*goal[:2]) <= 6
        assert np.linalg.norm(clip.translation[-1, :2] - goal[:2]) < 0.6
        still = np.linalg.norm(np.ptp(clip.translation[-30:, :2], axis=0))
        assert still < 0.3, "it ends with a stand"


def test_a_run_depends_on_the_seed_and_its_number_alone():
    two, three, other = runs(2), runs(3), runs(2, seed=1)
    for a, b in zip(two, three, strict=False):
        assert a.goals == b.goals and a.betas == b.betas
        np.testing.assert_allclose(a.translation, b.translation, atol=1e-5)
    assert two[0].goals != other[0].goals


def test_stops_are_visited_in_turn():
    told = []
    (clip,) = runs(1, stops=3, seconds=60.0, watch=lambda *done: told.append(done))
    assert len(clip.goals) == 3
    nearest = [
        np.linalg.norm(clip.translation[:, :2] - goal[:2], axis=-1).argmin() for goal in clip.goals
    ]
    assert nearest == sorted(nearest)
    assert told == [(1, 1)]


def test_a_run_ends_when_its_time_is_over():
    assert [clip.seconds for clip in runs(3, seconds=2.1)] == [2.1] * 3


def test_a_caption_says_who_and_how_near(clip):
    text = caption("run 3", clip)
    assert text.startswith("run 3") and "male" in text and "0.5 s" in text and "0.00 m" in text
