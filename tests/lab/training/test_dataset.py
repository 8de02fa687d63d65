from dataclasses import replace

import pytest
import torch

from tests.lab.training.fakes import gliding_frames, straight_walks
from wayfarer.errors import InvalidArgument
from wayfarer_lab.training.dataset import (
    WindowSampler,
    by_gender,
    draw_weights,
    load_frames,
)


def test_windows_never_cross_a_clip_edge():
    frames = gliding_frames(clips=3, length=20)
    index, _ = frames.starts(10)
    assert len(index) == 3 * 11
    assert ((index % 20) <= 10).all()


def test_clips_of_acted_styles_are_marked_and_their_mirror_images(tmp_path):
    walks = straight_walks(length=20)
    styled = ("Angry_FW", "Angry_BW", "Drunk_FW")
    clips = [replace(clip, name=name) for clip, name in zip(walks.clips, styled, strict=False)]
    replace(walks, clips=(*clips, *walks.clips[3:])).save(tmp_path)
    acted = load_frames(tmp_path, "train", {"walk": 1.0}).acted.view(2, 6, 20)
    assert acted[:, :3].all() and not acted[:, 3:].any()


def test_windows_longer_than_any_clip_are_refused():
    with pytest.raises(InvalidArgument, match="no unbroken stretch of 21"):
        gliding_frames(clips=3, length=20).starts(21)


def test_what_is_done_by_gender_comes_back_in_order():
    gender = torch.tensor([1, 0, 1, 1])
    values = torch.arange(4)
    (made,) = by_gender(gender, [10, 100], lambda factor, rows: (factor * values[rows],))
    assert made.tolist() == [0, 10, 200, 300]
    (alone,) = by_gender(gender[1:2], [10, 100], lambda factor, rows: (factor + rows,))
    assert alone.tolist() == [10]


def test_sampler_follows_the_weights():
    frames = gliding_frames(clips=2, length=20)
    frames.weight[:20] = 0.0
    frames.weight[30] = 9.0
    drawn = WindowSampler(frames, 10).draw(4000, torch.Generator().manual_seed(0))
    assert drawn.min() >= 20
    share = (drawn == 30).float().mean()
    assert 0.4 < share < 0.55  # 9 of 9 + 10


def test_groups_are_drawn_by_their_share_whatever_their_size():
    groups, subjects = ["walk"] * 30 + ["run"] * 10, ["a"] * 40
    weight = draw_weights(groups, subjects, {"walk": 0.25, "run": 0.75})
    assert weight[:30].sum() == pytest.approx(0.25)
    assert weight[30:].sum() == pytest.approx(0.75)


def test_a_mistyped_group_is_refused_with_the_allowed_ones():
    with pytest.raises(InvalidArgument, match=r"wlak.*allowed.*walk"):
        draw_weights(["walk"], ["a"], {"wlak": 1.0})
