import numpy as np
import pytest
from imageio_ffmpeg import read_frames
from PIL import Image

from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.pictures.files import choose_kind, film_rate, write_film, write_still
from wayfarer_lab.evaluation.pictures.film import Film


def moving(pictures=6, fps=20.0, size=(33, 24)):
    """A dark square that goes to the right over grey."""

    def draw(number):
        pixels = np.full((size[1], size[0], 3), 200, np.uint8)
        pixels[8:16, 2 + 3 * number : 10 + 3 * number] = (40, 60, 120)
        return Image.fromarray(pixels)

    return Film(pictures, fps, size, draw)


@pytest.mark.parametrize(
    ("name", "kind", "clips", "chosen"),
    [
        ("a.png", None, 1, "strip"),
        ("a.PNG", None, 2, "sheet"),
        ("a.png", "top", 3, "top"),
        ("a.gif", None, 1, "film"),
        ("a.mp4", None, 9, "film"),
        ("a.mp4", "crowd", 2, "crowd"),
    ],
)
def test_the_kind_follows_from_the_name(tmp_path, name, kind, clips, chosen):
    assert choose_kind(tmp_path / name, kind, clips) == chosen


@pytest.mark.parametrize(
    ("name", "kind", "clips", "message"),
    [
        ("a.jpg", None, 1, "must end in .png for strip or sheet"),
        ("a", None, 1, "must end in"),
        ("none/a.png", None, 1, "there is no folder"),
        ("a.png", "opera", 1, "allowed: strip, sheet, top, film, crowd"),
        ("a.png", "film", 1, "name the file .gif or .mp4"),
        ("a.gif", "strip", 1, "name the file .png"),
        ("a.png", "strip", 2, "--kind sheet"),
        ("a.png", None, 0, "nothing to draw"),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path, name, kind, clips, message):
    with pytest.raises(InvalidArgument, match=message):
        choose_kind(tmp_path / name, kind, clips)


def test_a_gif_has_only_rates_that_it_can_tell(tmp_path):
    assert film_rate(tmp_path / "a.gif", None) == 20
    assert film_rate(tmp_path / "a.gif", 25) == 25
    assert film_rate(tmp_path / "a.mp4", None) == 40
    assert film_rate(tmp_path / "a.mp4", 30) == 30
    with pytest.raises(InvalidArgument, match="10, 20, 25 or 50"):
        film_rate(tmp_path / "a.gif", 30)


def test_a_gif_holds_the_pictures_at_their_rate_for_ever(tmp_path):
    told = []
    write_film(tmp_path / "a.GIF", moving(), lambda *done: told.append(done))
    with Image.open(tmp_path / "a.GIF") as film:
        assert (film.format, film.n_frames, film.size) == ("GIF", 6, (33, 24))
        assert film.info["duration"] == 50 and film.info["loop"] == 0
        film.seek(5)
        shown = np.asarray(film.convert("RGB")).astype(int)
    assert abs(shown - np.asarray(moving().draw(5))).max() <= 8
    assert told == [(k, 6) for k in range(1, 7)]


def test_an_mp4_holds_the_pictures_at_their_rate_in_even_sides(tmp_path):
    write_film(tmp_path / "a.mp4", moving(fps=40.0), lambda *done: None)
    frames = read_frames(tmp_path / "a.mp4")
    about = next(frames)
    assert about["codec"] == "h264" and about["fps"] == 40 and about["size"] == (32, 24)
    shown = [np.frombuffer(f, np.uint8).reshape(24, 32, 3).astype(int) for f in frames]
    assert len(shown) == 6
    for number, pixels in enumerate(shown):
        assert pixels[12, 6 + 3 * number].max() < 150, "the square is where it was drawn"


def test_a_still_is_a_png(tmp_path):
    write_still(tmp_path / "a.png", moving().draw(0))
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.format == "PNG"
        assert (np.asarray(picture) == np.asarray(moving().draw(0))).all()


@pytest.mark.parametrize("name", ["a.gif", "a.mp4"])
@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_a_film_that_is_broken_off_leaves_nothing_and_spoils_nothing(tmp_path, name, error):
    (tmp_path / name).write_text("what was there before")

    def stop(done, total):
        if done == 3:
            raise error

    with pytest.raises(error):
        write_film(tmp_path / name, moving(), stop)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "what was there before"
