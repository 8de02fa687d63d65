import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from wayfarer.body.library import load_body
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.errors import DataError
from wayfarer.spec import PRIMITIVE_FRAMES
from wayfarer_lab.training.mocap.rig import MIRROR
from wayfarer_lab.training.mocap.store import FILE, ClipRange, Dataset, atomically, mirror


def random_motion(frames: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    turns = Rotation.random(frames * 22, random_state=seed).as_quat().reshape(frames, 22, 4)
    return generator.normal(size=(frames, 3)), turns, generator.random((frames, 2)) > 0.5


def test_mirroring_twice_changes_nothing() -> None:
    motion = random_motion(7)
    for once, twice in zip(motion, mirror(*mirror(*motion)), strict=True):
        np.testing.assert_array_equal(once, twice)


@pytest.mark.parametrize("gender", ["male", "female"])
def test_a_mirrored_motion_is_seen_in_a_mirror(gender: str) -> None:
    body = load_body("anny52", gender)
    rest = body.rest_joints(np.zeros(10))
    hips, turns, contacts = random_motion(5)
    _, places = body.forward_kinematics(hips, matrix_from_quaternion(turns), rest)
    hips, turns, swapped = mirror(hips, turns, contacts)
    _, image = body.forward_kinematics(hips, matrix_from_quaternion(turns), rest)
    reflected = places[:, :22][:, MIRROR] * [-1, 1, 1]
    np.testing.assert_allclose(
        image[:, :22], reflected, atol=2e-3
    )  # bodies are symmetrical to 2 mm
    np.testing.assert_array_equal(swapped, contacts[:, ::-1])


def test_mirror_refuses_other_skeletons() -> None:
    with pytest.raises(DataError, match=r"\[22, 4\]"):
        mirror(np.zeros(3), np.zeros((21, 4)), np.zeros(2))


def clip(start: int, stop: int, **known: object) -> ClipRange:
    fields = {"name": "a", "source": "a", "subject": "s", "split": "train", "category": "walk"}
    fields |= {"locomotion": True, "gender": "male", "betas": (0.5,) * 10, "shape": "own"}
    return ClipRange(start, stop, **{**fields, "augmentation": "", **known})


def dataset(lengths: list[int]) -> Dataset:
    hips, turns, contacts = random_motion(sum(lengths))
    edges = np.cumsum([0, *lengths]).tolist()
    return Dataset(
        hips.astype(np.float32),
        turns.astype(np.float32),
        contacts,
        np.ones(sum(lengths), np.uint8),
        tuple(clip(a, b, name=str(a)) for a, b in itertools.pairwise(edges)),
    )


def test_windows_stay_within_clips_and_use() -> None:
    data = dataset([12, 9, 10])
    np.testing.assert_array_equal(data.windows(PRIMITIVE_FRAMES), [0, 1, 2, 21])
    data.use[1] = 0
    np.testing.assert_array_equal(data.windows(PRIMITIVE_FRAMES), [2, 21])
    assert len(data.windows(1000)) == 0


def test_saved_data_are_read_back(tmp_path) -> None:
    data = dataset([100, 20])
    data.save(tmp_path)
    back = Dataset.load(tmp_path)
    assert back.clips == data.clips
    np.testing.assert_array_equal(back.rotations, data.rotations)
    with np.load(tmp_path / FILE) as file:
        assert len(file["rollout_starts"]) == 19  # 82 frames of 100
        assert len(file["primitive_starts"]) == 91 + 11


def test_a_folder_that_is_not_prepared_is_named(tmp_path) -> None:
    with pytest.raises(DataError, match="data prepare"):
        Dataset.load(tmp_path)
    (tmp_path / FILE).write_bytes(b"not an archive")
    with pytest.raises(DataError, match=FILE):
        Dataset.load(tmp_path)


def test_a_failed_write_leaves_what_was_there(tmp_path) -> None:
    path = tmp_path / "x.txt"
    atomically(path, lambda p: p.write_text("whole"))

    def fail(p):
        p.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        atomically(path, fail)
    assert path.read_text() == "whole"
    assert list(tmp_path.iterdir()) == [path]
