from pathlib import Path

import numpy as np
import pytest

from tests.lab.evaluation.recordings import write_recordings
from wayfarer.clips.files import write_clip
from wayfarer.errors import DataError, InvalidArgument, NotFound
from wayfarer_lab.evaluation.pictures.sources import cut, read_files, recorded
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
