from dataclasses import replace

import pytest
import torch

from tests.lab.training.fakes import straight_walks
from wayfarer.errors import InvalidArgument
from wayfarer.marker_bodies import load_marker_bodies
from wayfarer.spec import FPS
from wayfarer_lab.training.likeness import FRAMES
from wayfarer_lab.training.walks import Walks, is_plain, is_steady


@pytest.fixture(scope="module")
def bodies():
    return load_marker_bodies("anny52")


def test_windows_are_drawn_at_the_speeds_asked_for(bodies):
    torch.manual_seed(0)
    walks = Walks(straight_walks(), "train", bodies, windows=90)
    assert walks.markers["male"].shape == (90, FRAMES, 67, 3)
    asked = torch.tensor([0.8, 1.2, 1.6])
    windows = walks.like("female", asked)
    hips = windows[:, [0, -1], 0, :2]
    found = (hips[:, 1] - hips[:, 0]).norm(dim=-1) * FPS / (FRAMES - 1)
    assert (found - asked).abs().max() < 0.3  # legs of random shapes go at other speeds
    assert found.diff().min() > 0
    assert walks.markers["male"][..., 2].amin((1, 2)).std() < 1e-4, "soles keep their height"


def test_without_a_plain_straight_walk_there_is_an_error_that_says_so(bodies):
    for data in (straight_walks(name="Zombie_FW"), straight_walks(speeds=(2.5,))):
        with pytest.raises(InvalidArgument, match=r"no steady male walk of 1\.6 s"):
            Walks(data, "train", bodies, windows=5)
    with pytest.raises(InvalidArgument, match="validation"):
        Walks(straight_walks(), "validation", bodies, windows=5)


def test_plain_clips_are_recorded_and_of_no_style():
    clip = straight_walks().clips[0]
    for name, plain in (("07_01", True), ("Neutral_FW", True), ("Zombie_FW", False)):
        assert is_plain(replace(clip, name=name)) is plain
    assert not is_plain(replace(clip, category="walk_styled"))
    assert not is_plain(replace(clip, augmentation="warp:0.9"))


def test_steady_walks_are_straight_even_and_face_their_way():
    time = torch.arange(FRAMES) / FPS
    north = torch.tensor([0.0, 1.0]).expand(FRAMES, 2)

    def along(x, y):
        return torch.stack([x + 0 * time, y + 0 * time, 1 + 0 * time], -1)

    straight = along(0.0, 1.2 * time)
    cases = [
        (straight, north, True),
        (along(0.0, 0.3 * time), north, False),  # slower than walks
        (along(0.0, 0.5 * time + 0.5 * time**2), north, False),  # gets faster
        (along(1.2 * torch.sin(time), 1.2 * torch.cos(time)), north, False),  # a bend
        (straight, north.flip(-1), False),  # sideways
    ]
    hips, facing = (torch.stack([c[k] for c in cases]) for k in (0, 1))
    assert is_steady(hips, facing).tolist() == [c[2] for c in cases]
