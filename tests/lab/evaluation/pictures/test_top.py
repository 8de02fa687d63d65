import numpy as np
import pytest

from wayfarer_lab.evaluation.pictures.paper import GOAL, LEFT, TRAIL
from wayfarer_lab.evaluation.pictures.top import top_view


def colour(code):
    return np.array([int(code[k : k + 2], 16) for k in (1, 3, 5)])


def places(pixels, picture, code):
    """Rows and columns of pixels near a colour; letters in the corner are left out."""
    near = abs(pixels(picture) - colour(code)).max(-1) < 40
    near[-20:, :60] = False
    return np.argwhere(near)


def test_trail_and_goal_are_inside_the_picture(act, pixels):
    picture = top_view([act(goals=((3.0, 4.0, 0.0),))], (200, 120))
    assert picture.size == (200, 120)
    for code in (TRAIL, GOAL):
        found = places(pixels, picture, code)
        assert len(found) > 10
        assert (found > 3).all() and (found < np.array([117, 197])).all()
    # the goal is to the right of the trail and above it
    trail, goal = (places(pixels, picture, code).mean(0) for code in (TRAIL, GOAL))
    assert goal[1] > trail[1] + 20 and goal[0] < trail[0] - 20


def test_contacts_are_dots_where_the_foot_was(act, clip, pixels):
    free = np.zeros_like(clip.contacts)
    assert len(places(pixels, top_view([act(contacts=free)], (150, 150)), LEFT)) == 0
    left = places(pixels, top_view([act()], (150, 150)), LEFT)
    trail = places(pixels, top_view([act()], (150, 150)), TRAIL)
    assert left[:, 1].mean() < trail[:, 1].mean(), "walking up, its left foot is on the left"


@pytest.mark.parametrize("size", [(60, 60), (300, 100)])
def test_standing_is_not_magnified_and_many_fit(act, clip, size):
    still = np.tile(clip.translation[:1], (clip.frames, 1))
    alone = act(translation=still, goals=())
    crowd = [act(by=(9.0 * k, -5.0 * k, 0)) for k in range(4)]
    assert top_view([alone], size).size == top_view(crowd, size).size == size
