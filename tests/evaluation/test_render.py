import numpy as np
import pytest

pytest.importorskip("PIL", reason="pillow is missing: pip install 'wayfarer[train]'")

from wayfarer.body.library import load_body
from wayfarer.clips.clip import Clip
from wayfarer.clips.npz import write_npz
from wayfarer.errors import InvalidArgument
from wayfarer.evaluation.render import render, strip, top_view


@pytest.fixture(scope="module")
def body():
    return load_body("anny52", "male", "low")


def gliding(body, sink=0.0, contacts=True):
    """A T-pose that glides 1 m ahead with its soles on the floor, or `sink` below."""
    frames = 20
    hips = body.rest_joints(np.zeros(10))[0, 2]
    translation = np.zeros((frames, 3))
    translation[:, 1] = np.linspace(0, 1, frames)
    translation[:, 2] = hips - sink
    rotations = np.zeros((frames, 22, 4))
    rotations[..., 3] = 1
    flags = np.full((frames, 2), contacts)
    return Clip(translation, rotations, flags, "male", (0.0,) * 10, goals=((0.0, 1.0, 0.0),))


def pixels(picture):
    return np.asarray(picture).astype(int)


def reddish(picture):
    """Number of pixels in the red that marks what is below the floor."""
    r, g, b = np.moveaxis(pixels(picture), -1, 0)
    return int(((r > 140) & (r > 1.6 * g) & (r > 1.6 * b)).sum())


def test_a_strip_has_a_cell_per_interval(body):
    few = strip(gliding(body), body, every=10, pixels_per_metre=40)
    many = strip(gliding(body), body, every=5, columns=2, pixels_per_metre=40)
    assert few.width >= 900  # the chart's least width
    assert many.height - few.height == int(2.25 * 40)  # two rows in place of one


@pytest.mark.parametrize("view", ["side", "front", "body"])
def test_bodies_are_drawn_in_every_view(body, view):
    picture = strip(gliding(body), body, every=10, view=view, pixels_per_metre=40)
    first = pixels(picture)[: int(2.25 * 40), : int(1.45 * 40)]
    assert ((first < 235).any(-1)).mean() > 0.05


def test_sunken_feet_are_marked_and_standing_ones_are_not(body):
    on_floor = strip(gliding(body, contacts=False), body, every=10, pixels_per_metre=60)
    sunken = strip(gliding(body, sink=0.06, contacts=False), body, every=10, pixels_per_metre=60)
    assert reddish(sunken) > reddish(on_floor) + 20


def test_the_view_from_above_shows_trail_goal_and_contacts(body):
    clip = gliding(body)
    with_contacts = top_view([clip], [body], size=300)
    without = top_view([gliding(body, contacts=False)], [body], size=300)
    assert max(with_contacts.size) == 300
    assert (pixels(with_contacts) != pixels(without)).any()
    elsewhere = top_view([clip], [body], goals=[(2.0, 2.0)], size=300)
    assert elsewhere.size != with_contacts.size


def test_unknown_views_and_missing_bodies_are_refused(body):
    with pytest.raises(InvalidArgument, match="allowed: side, front, body"):
        strip(gliding(body), body, view="below")
    with pytest.raises(InvalidArgument, match="1 clips and 0 bodies"):
        top_view([gliding(body)], [])


def test_the_command_writes_a_picture(tmp_path, body, capsys):
    write_npz(tmp_path / "walk.npz", gliding(body), body)
    for view in ("side", "top"):
        render(tmp_path / "walk.npz", tmp_path / f"{view}.png", view=view, every=20, columns=10)
        assert (tmp_path / f"{view}.png").read_bytes().startswith(b"\x89PNG")
    assert "0.5 s of motion" in capsys.readouterr().out
