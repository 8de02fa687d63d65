import numpy as np
import pytest

from tests.world.fakes import BODIES, FakeEngine, make_world
from wayfarer.clips.generate import generate_clip
from wayfarer.clips.planned import plan_clip
from wayfarer.errors import FailedPrecondition
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering
from wayfarer.world.search.beam_settings import BeamSettings

GOALS = [Goal((0.0, 2.0, 0.0)), Goal((1.0, 0.0, 0.0))]


def planned(goals, seconds, settings=None, engine=None, spec=None, **about):
    spec = spec or AgentSpec(noise_seed=4)
    [start] = make_world().prepare([spec])
    settings = settings or BeamSettings()
    body = BODIES[spec.gender]
    return plan_clip(engine or FakeEngine(), body, spec, start, goals, seconds, settings, **about)


def test_goals_are_visited_in_turn_and_the_rest_of_the_time_is_spent_standing():
    heard = []
    clip = planned(GOALS, 15.0, watch=heard.append)
    assert clip.frames == 600
    assert clip.meta == {"goals_reached": "2", "primitives_rejected": "0"}
    assert clip.goals == tuple(goal.position for goal in GOALS)
    nearest = [
        np.linalg.norm(clip.translation[:, :2] - goal.position[:2], axis=-1) for goal in GOALS
    ]
    assert all(distance.min() <= 0.3 for distance in nearest)
    assert nearest[0].argmin() < nearest[1].argmin()
    assert np.ptp(clip.translation[-40:, :2], axis=0).max() < 0.05
    assert heard == sorted(heard) and heard[-1] == 15.0


def test_keeping_one_it_is_the_clip_made_online():
    """Without the foot lock, which a plan has once all of it is known."""
    spec = AgentSpec(noise_seed=9, foot_lock=False)
    world = make_world(steering=Steering(reactions=1).with_search(candidates=8))
    goals = GOALS[:1]
    online = generate_clip(world, spec, goals, 4.0)
    clip = planned(goals, 4.0, BeamSettings(keep=1, children=8), spec=spec)
    on_the_way = slice(None, 56)  # then it stands, and a plan plants no feet
    np.testing.assert_array_equal(clip.translation[on_the_way], online.translation[on_the_way])
    np.testing.assert_allclose(clip.rotations[on_the_way], online.rotations[on_the_way], atol=1e-6)
    np.testing.assert_array_equal(clip.contacts[on_the_way], online.contacts[on_the_way])


def test_seconds_that_are_no_whole_primitives_are_cut():
    assert planned([], 0.5).frames == 20


def test_a_search_without_a_way_on_says_so():
    engine = FakeEngine()
    engine.nan_for_beta = 0.0
    with pytest.raises(FailedPrecondition, match=r"no way on after 0\.0 s"):
        planned(GOALS, 2.0, engine=engine)
