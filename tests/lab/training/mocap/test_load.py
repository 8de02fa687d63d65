"""Messages about files that are read, and refusals."""

import numpy as np
import pytest

from tests.lab.training.mocap.synthetic import bvh_text, standing_rows
from tests.lab.training.mocap.synthetic_files import fbx_of
from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.bvh import read_bvh
from wayfarer_lab.training.mocap.load import Piece, ReadOptions, load_pieces, read_recordings
from wayfarer_lab.training.mocap.rig import J
from wayfarer_lab.training.mocap.sources import SourceFile

STYLE100 = {
    "Spine": "Chest", "Spine1": "Chest2", "Spine2": "Chest3", "UpLeg": "Hip", "Leg": "Knee",
    "Foot": "Ankle", "ToeBase": "Toe", "Shoulder": "Collar", "Arm": "Shoulder", "ForeArm": "Elbow",
    "Hand": "Wrist",
}  # fmt: skip


def loaded(path, fps: float | None = None) -> tuple[list[Piece], list[str]]:
    told: list[str] = []
    (recording,) = read_recordings(SourceFile("a", path, "s", fps=fps), None, ReadOptions())
    return load_pieces(recording, ReadOptions(), tell=told.append), told


def saved(tmp_path, fps: float, frames: int = 200):
    path = tmp_path / "a.bvh"
    path.write_text(bvh_text(standing_rows(frames), fps))
    return path


@pytest.mark.parametrize("fps", [23.976, 25, 29.97, 59.94, 119.88])
def test_rates_of_film_and_television_are_read(fps, tmp_path) -> None:
    (piece,), told = loaded(saved(tmp_path, fps))
    skipped = round(10 / 120 * fps)
    assert len(piece.places) == pytest.approx((200 - skipped) / fps * 40, abs=2)
    assert told == []


@pytest.mark.parametrize("fps", [12, 23])
def test_lower_ones_are_refused(fps, tmp_path) -> None:
    with pytest.raises(DataError, match=rf"a\.bvh: {fps} frames per second; at least 24"):
        loaded(saved(tmp_path, fps))


@pytest.mark.parametrize("kind", ["bvh", "fbx"])
def test_an_index_that_contradicts_the_file_counts_and_is_told(kind, tmp_path) -> None:
    path = saved(tmp_path, 60.0)
    if kind == "fbx":
        pytest.importorskip("ufbx")
        motion = read_bvh(path.read_text())
        path = tmp_path / "a.fbx"
        path.write_text(fbx_of({"Take": motion}))
    (piece,), told = loaded(path, 120.0)
    assert told == ["a: the index says 120 frames a second, the file 60; the index counts"]
    assert len(piece.places) == pytest.approx(64, abs=2)
    assert loaded(path, 60.2)[1] == []


def test_stretches_too_short_for_a_motion_do_not_matter(tmp_path) -> None:
    rows = standing_rows(200)
    rows[[60, 63, 69, 74], 0] += 300  # jumps, with a frame or two between
    path = tmp_path / "a.bvh"
    path.write_text(bvh_text(rows, 30.0))
    pieces, _ = loaded(path)
    assert [len(p.places) >= 20 for p in pieces] == [True, True]


def test_an_upper_arm_named_shoulder_beside_a_collar_turns_as_an_upper_arm(tmp_path) -> None:
    """100STYLE's names, without renaming."""
    rows = standing_rows(60)
    text = bvh_text(rows, 60.0)
    (right,), _ = loaded(saved(tmp_path, 60.0, 60))
    for side in ("Left", "Right", ""):
        for ours, theirs in sorted(STYLE100.items(), key=lambda pair: -len(pair[0])):
            if bool(side) != ours.startswith("Spine"):
                text = text.replace(f"T {side}{ours}\n", f"T #{side}{theirs}\n")
    path = tmp_path / "a.bvh"
    path.write_text(text.replace("#", ""))
    (piece,), _ = loaded(path)
    np.testing.assert_array_equal(piece.places, right.places)
    np.testing.assert_array_equal(piece.rotations, right.rotations)
    hanging = piece.places[:, J["left_shoulder"], 2] - piece.places[:, J["left_elbow"], 2]
    assert (hanging > 0.2).all()
