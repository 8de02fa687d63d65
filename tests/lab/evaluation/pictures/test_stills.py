import numpy as np
import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.pictures.stills import contact_sheet, strip


def test_a_strip_has_a_cell_per_interval(act):
    few, many = (strip(act(), every, "side", 2, height=48) for every in (10, 5))
    assert few.width >= 900  # the chart's least width
    assert many.height - few.height == 48  # two rows in place of one


def test_cells_show_other_moments_and_report_how_many(act, pixels):
    told = []
    sheet = pixels(strip(act(), every=10, height=64, watch=lambda *done: told.append(done)))
    assert told == [(1, 2), (2, 2)]
    cell = round(0.62 * 64)
    assert (sheet[20:64, : cell - 1] != sheet[20:64, cell : 2 * cell - 1]).any()


def test_contact_flags_are_shown(act, clip, pixels):
    flags = np.zeros_like(clip.contacts)
    touching, free = (strip(act(contacts=c), 10, height=64) for c in (clip.contacts, flags))
    assert (pixels(touching) != pixels(free)).any()


def test_a_sheet_has_a_row_for_each_clip(act, pixels):
    one = contact_sheet([act()], ["a"], columns=3, height=48)
    two = contact_sheet([act(), act(by=(1, 0, 0))], ["a", "b"], columns=3, height=48)
    assert two.size == (one.width, 2 * one.height)
    rows = pixels(two).reshape(2, one.height, one.width, 3)
    assert all((row < 200).any(-1).mean() > 0.02 for row in rows)


@pytest.mark.parametrize("draw", [strip, lambda actor, **o: contact_sheet([actor], ["a"], **o)])
def test_unknown_views_and_empty_rows_are_refused(act, draw):
    with pytest.raises(InvalidArgument, match="allowed: quarter"):
        draw(act(), view="below")
    with pytest.raises(InvalidArgument, match="columns"):
        draw(act(), columns=0)
