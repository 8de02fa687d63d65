from dataclasses import replace

import numpy as np
import pytest

from tests.world.fakes import motion_chunk
from wayfarer.clips.clip import join_chunks
from wayfarer.errors import InvalidArgument
from wayfarer.world.agents.agent import AgentSpec


def chunk(seq):
    return motion_chunk(seq, translation=np.full((8, 3), seq, np.float32))


def test_chunks_become_a_clip_in_order_of_seq():
    spec = AgentSpec(gender="male", betas=(0.5,) * 10)
    clip = join_chunks([chunk(1), chunk(0)], spec)
    assert clip.frames == 16
    assert clip.seconds == pytest.approx(0.4)
    assert clip.translation[[0, 8], 0].tolist() == [0, 1]
    assert (clip.gender, clip.betas) == ("male", (0.5,) * 10)


def test_a_gap_between_chunks_is_refused():
    with pytest.raises(InvalidArgument, match="missing before chunk 2"):
        join_chunks([chunk(0), chunk(2)], AgentSpec())
    with pytest.raises(InvalidArgument, match="no chunk"):
        join_chunks([], AgentSpec())


@pytest.mark.parametrize("field", ["translation", "rotations", "contacts"])
def test_fields_must_agree_in_length(clip, field):
    with pytest.raises(InvalidArgument, match=field if field != "translation" else "rotations"):
        replace(clip, **{field: getattr(clip, field)[:-1]})


def test_nan_and_bad_rates_are_refused(clip):
    broken = clip.translation.copy()
    broken[3, 1] = np.nan
    with pytest.raises(InvalidArgument, match="translation holds NaN"):
        replace(clip, translation=broken)
    with pytest.raises(InvalidArgument, match="fps"):
        replace(clip, fps=0)


def test_a_clip_is_cut_by_slices(clip):
    part = clip[5:9]
    assert part.frames == 4
    assert (part.translation == clip.translation[5:9]).all()
    with pytest.raises(InvalidArgument, match="steps"):
        clip[::2]
    with pytest.raises(InvalidArgument, match="N ≥ 1"):
        clip[7:7]
