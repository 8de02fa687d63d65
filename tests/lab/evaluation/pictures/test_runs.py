"""Random runs through the real world with an engine that glides."""

import numpy as np

from tests.world.fakes import make_world
from wayfarer.spec import GENDERS
from wayfarer_lab.evaluation.pictures.runs import caption, random_runs


def runs(count, seed=0, **options):
    return random_runs(make_world(phases=1), count, seed, **options)


def test_people_go_to_their_goals_and_stand():
    made = runs(4)
    assert [clip.gender for clip in made] == list(GENDERS) * 2
    assert len({clip.betas for clip in made}) == 4
    for clip in made:
        (goal,) = clip.goals
        assert 2 <= np.hypot(*goal[:2]) <= 6
        assert np.linalg.norm(clip.translation[-1, :2] - goal[:2]) < 0.6
        still = np.linalg.norm(np.ptp(clip.translation[-30:, :2], axis=0))
        assert still < 0.3, "it ends with a stand"


def test_a_run_depends_on_the_seed_and_its_number_alone():
    two, three, other = runs(2), runs(3), runs(2, seed=1)
    for a, b in zip(two, three, strict=False):
        assert a.goals == b.goals and a.betas == b.betas
        np.testing.assert_allclose(a.translation, b.translation, atol=1e-5)
    assert two[0].goals != other[0].goals


def test_stops_are_visited_in_turn():
    told = []
    (clip,) = runs(1, stops=3, seconds=60.0, watch=told.append)
    assert len(clip.goals) == 3
    nearest = [
        np.linalg.norm(clip.translation[:, :2] - goal[:2], axis=-1).argmin() for goal in clip.goals
    ]
    assert nearest == sorted(nearest)
    assert told == sorted(told) and told[-1] <= 60


def test_a_run_ends_when_its_time_is_over():
    assert [clip.seconds for clip in runs(3, seconds=2.1)] == [2.1] * 3


def test_a_caption_says_who_and_how_near(clip):
    text = caption("run 3", clip)
    assert text.startswith("run 3") and "male" in text and "0.5 s" in text and "0.00 m" in text
