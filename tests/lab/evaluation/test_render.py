"""`wayfarer render`: from clips, recordings and runs to files."""

import sys
from types import SimpleNamespace

import pytest
from PIL import Image

from tests.lab.evaluation.recordings import write_recordings
from tests.world.fakes import make_world
from wayfarer.clips.files import write_clip
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer_lab.evaluation import render as module
from wayfarer_lab.evaluation.pictures.sources import recorded
from wayfarer_lab.evaluation.render import render


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder of recordings, `motion.npz`, with one of them as a clip, `walk.npz`."""
    made = write_recordings(tmp_path_factory.mktemp("data"))
    clip = recorded(made, ["c1"])["c1"][:12]
    write_clip(made / "walk.npz", clip)
    return made


@pytest.fixture
def gliding(monkeypatch):
    """Makes runs use an engine that glides."""
    bundle = SimpleNamespace(world=lambda agents, steering: make_world(phases=1))
    monkeypatch.setattr(module, "open_bundle", lambda model, threads: bundle)


@pytest.mark.parametrize("kind", ["strip", "sheet", "top"])
def test_stills_of_a_clip(tmp_path, folder, kind, capsys):
    out = tmp_path / f"{kind}.png"
    render([folder / "walk.npz"], out=out, kind=kind, every=6, columns=2, size=48)
    with Image.open(out) as picture:
        assert picture.format == "PNG" and picture.height >= 48
        assert f"{picture.width} × {picture.height} px, 0.3 s" in capsys.readouterr().out


@pytest.mark.parametrize("kind", [None, "crowd"])
def test_films_of_a_clip_beside_a_recording(tmp_path, folder, kind, capsys):
    out = tmp_path / "a.gif"
    render(
        [folder / "walk.npz"], out=out, kind=kind, data=folder, clip=["c0"], seconds=0.2, size=48
    )
    with Image.open(out) as film:
        assert film.n_frames == 4
        assert film.size == ((85, 48) if kind == "crowd" else (96, 48))
    assert "4 pictures, 0.2 s" in capsys.readouterr().out


def test_a_sheet_of_random_runs(tmp_path, gliding, capsys):
    render(out=tmp_path / "sheet.png", goals=3, seconds=1.0, columns=2, size=40)
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.height > 3 * 40
    assert "3.0 s of motion" in capsys.readouterr().out


def test_runs_are_cut_as_clips_are(tmp_path, gliding, capsys):
    render(out=tmp_path / "a.png", goals=1, start=1.0, seconds=0.4, kind="top", size=40)
    assert "0.4 s of motion" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "nothing to draw"),
        ({"goals": 2, "kind": "strip"}, "--kind sheet"),
        ({"goals": 1, "view": "below"}, "allowed: quarter"),
        ({"goals": 1, "clip": ["c0"]}, "go together"),
        ({"goals": 1, "look": "naked"}, "allowed: dressed, sides"),
    ],
)
def test_wrong_wishes_are_refused_and_nothing_is_written(tmp_path, gliding, arguments, message):
    with pytest.raises(InvalidArgument, match=message):
        render(out=tmp_path / "a.png", **arguments)
    assert not list(tmp_path.iterdir())


def test_unknown_clips_are_refused(tmp_path, folder):
    with pytest.raises(NotFound, match="no such file"):
        render([folder / "none.npz"], out=tmp_path / "a.png")
    with pytest.raises(NotFound, match="the nearest"):
        render(out=tmp_path / "a.png", data=folder, clip=["none"])


def test_mp4_without_ffmpeg_fails_before_anything_is_drawn(tmp_path, folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ModuleNotFoundError) as caught:
        render([folder / "walk.npz"], out=tmp_path / "a.mp4")
    assert caught.value.name == "imageio_ffmpeg"  # which `wayfarer` turns into what to install
    assert not list(tmp_path.iterdir())
