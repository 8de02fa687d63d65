import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.lab.training.mocap.synthetic import AMC, ASF, edited
from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.asf import read_amc, read_asf


def rotation(x: float, y: float, z: float) -> np.ndarray:
    """Rz · Ry · Rx, written down independently of the reader."""
    return Rotation.from_euler("xyz", [x, y, z], degrees=True).as_matrix()


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_forward_kinematics_follow_the_format(newline: str) -> None:
    asf = read_asf(ASF.replace("\n", newline))
    motion = read_amc(AMC.replace("\n", newline), asf)
    turns, places = motion.world()
    names = asf.skeleton.names
    root = rotation(10, 20, 30)
    c_upper, c_lower = rotation(10, 20, 30), rotation(0, 0, 40)
    upper = root @ c_upper @ rotation(15, 25, 35) @ c_upper.T
    lower = upper @ c_lower @ rotation(45, 0, 0) @ c_lower.T
    end_of_upper = np.array([1, 2, 3]) + upper @ [2, 0, 0]
    end_of_lower = end_of_upper + lower @ [0, -3, 0]
    np.testing.assert_allclose(turns[0, names.index("lower")], lower, atol=1e-12)
    np.testing.assert_allclose(places[0, names.index("lower")], end_of_upper, atol=1e-12)
    np.testing.assert_allclose(places[0, names.index("tip")], end_of_lower, atol=1e-12)
    np.testing.assert_allclose(turns[1], np.broadcast_to(np.eye(3), turns[1].shape), atol=1e-12)


def test_units_and_unknown_rate() -> None:
    asf = read_asf(ASF)
    assert asf.unit == pytest.approx(0.0254 / 0.45)
    assert read_amc(AMC, asf).fps is None
    assert asf.skeleton.ends["tip"] == pytest.approx([0, 0, 1])


@pytest.mark.parametrize(
    ("line", "old", "new", "reason"),
    [
        (14, "1 0 0", "1 zero 0", "direction"),
        (15, "length 2", "", "lacks"),
        (17, "rx ry rz", "rx tq", "dof"),
        (38, "lower tip", "nobody tip", "cannot hang"),
    ],
)
def test_malformed_asf_names_the_line(line: int, old: str, new: str, reason: str) -> None:
    with pytest.raises(DataError, match=reason) as caught:
        read_asf(edited(ASF, line, lambda text: text.replace(old, new)), "s.asf")
    # a missing field is noticed where its bone ends
    assert caught.value.line == (18 if reason == "lacks" else line)
    assert str(caught.value).startswith("s.asf:")


@pytest.mark.parametrize(
    ("line", "new", "reason", "named"),
    [
        (6, "upper 15 25", "needs 3 numbers", 6),
        (6, "upper 15 25 x", "could not convert", 6),
        (7, "ghost 1", "no moving bone 'ghost'", 7),
        (6, "", "lacks", 7),
        (4, "root 1 2 3 4 5 6", "frame number", 4),
    ],
)
def test_malformed_amc_names_the_line(line: int, new: str, reason: str, named: int) -> None:
    with pytest.raises(DataError, match=reason) as caught:
        read_amc(edited(AMC, line, lambda _: new), read_asf(ASF), "s.amc")
    assert caught.value.line == named


def test_amc_cut_off_in_its_last_frame_keeps_the_frames_before() -> None:
    motion = read_amc(AMC.rstrip().rsplit("\n", 1)[0], read_asf(ASF))
    assert len(motion) == 1
    with pytest.raises(DataError, match="no frames"):
        read_amc(":DEGREES\n", read_asf(ASF))
