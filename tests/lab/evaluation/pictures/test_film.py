from itertools import pairwise

import numpy as np
import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.pictures.film import crowd_film, follow_film, gathered


def test_a_film_has_the_clips_length_and_its_pictures_differ(act, pixels):
    film = follow_film([act()], ["walk"], size=48, fps=10.0)
    assert film.pictures == 5 and film.seconds == 0.5 and film.size == (48, 48)
    pictures = [pixels(film.draw(number)) for number in range(film.pictures)]
    assert all(picture.shape == (48, 48, 3) for picture in pictures)
    assert all((a != b).any() for a, b in pairwise(pictures))


def test_clips_are_beside_each_other_and_the_shorter_one_waits(act, clip, pixels):
    actors = [act(), act(translation=clip.translation[:4], rotations=clip.rotations[:4],
                         contacts=clip.contacts[:4]), act()]  # fmt: skip
    film = follow_film(actors, ["a", "b", "c"], size=40, fps=10.0)
    assert film.size == (80, 80) and film.draw(0).size == (80, 80)
    early, late = (pixels(film.draw(number))[:40, 40:] for number in (2, 4))
    assert (early == late).all()


def test_the_camera_before_a_crowd_stands_still(act, pixels):
    film = crowd_film([act(), act(by=(2, 0, 0))], height=54, fps=10.0)
    assert film.size == (96, 54)
    first, last = (pixels(film.draw(number)) for number in (0, film.pictures - 1))
    changed = (abs(first - last) > 4).any(-1)
    assert 0.01 < changed.mean() < 0.5
    assert not changed[0].any()


def test_gathered_people_keep_apart_and_their_motion(act, clip):
    rng = np.random.default_rng(0)
    clips = [act(by=(*rng.uniform(-30, 30, 2), 0)).clip for _ in range(12)]
    placed = gathered(clips)
    for before, after in zip(clips, placed, strict=True):
        step = after.translation - before.translation
        np.testing.assert_allclose(step, np.tile(step[:1], (clip.frames, 1)), atol=1e-9)
        assert step[0, 2] == 0
        np.testing.assert_allclose(np.subtract(after.goals, before.goals)[0], step[0], atol=1e-9)
    for a in range(12):
        for b in range(a):
            way = placed[a].translation - placed[b].translation
            assert np.linalg.norm(way[:, :2], axis=-1).min() >= 0.9
    assert np.ptp([c.translation[0, :2] for c in placed], axis=0).max() < 12


def test_unknown_views_are_refused(act):
    with pytest.raises(InvalidArgument, match="allowed: quarter"):
        follow_film([act()], ["a"], 48, 10.0, view="below")
