"""What a crowd asks of its networks while it is served."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from wayfarer.body.library import load_body
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.errors import ArtifactError
from wayfarer.limits import Limits
from wayfarer.marker_bodies import marker_body
from wayfarer.motion.policy import Condition, GoalPolicy
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import BETAS, LATENT
from wayfarer.terms import TERMS
from wayfarer.world.agents.goal import check_goal
from wayfarer_lab.training.cli import SHIPPED
from wayfarer_lab.training.visited import Visited, command, load_visited, visit, write_visited


class Overheard(GoalPolicy):
    """Keeps what it is asked."""

    def forward(self, seed, condition):
        self.asked = seed, condition
        return super().forward(seed, condition)


def test_questions_are_what_the_step_asks_its_policy():
    model = load_body("anny52", "male")
    body, policy = marker_body(model), Overheard()
    sites = Sites.from_names(model.marker_names)
    step = PrimitiveStep(MarkerPredictor(2), BodyRegressor(body), body, sites, policy)
    inputs = dummy_inputs(5, 1)
    turned = np.random.default_rng(0).standard_normal(inputs.facing.shape).astype(np.float32)
    inputs = replace(inputs, facing=turned, goal=inputs.goal + np.float32(3))
    with torch.no_grad():
        step(*(torch.from_numpy(getattr(inputs, f.name)) for f in fields(inputs)))
    seed, condition = policy.asked
    found = Visited.of(inputs, floor_origin=True)
    assert torch.allclose(found.seed, seed, atol=1e-6)
    for name in Condition._fields:
        assert torch.allclose(getattr(found.condition, name), getattr(condition, name), atol=1e-5)
    assert torch.equal(found.manner, torch.from_numpy(inputs.noise[:, 0]))


def test_people_who_are_sent_about_ask_at_every_step():
    found = visit(SHIPPED, agents=4, seconds=6.0, candidates=1, seed=0)
    assert 4 * 28 <= len(found) <= 4 * 40  # each takes 30 steps; a command may add one
    assert found.seed.shape[1:] == (2, 201) and found.manner.shape[1:] == (LATENT,)
    assert found.term_weights.shape[1:] == (len(TERMS),)
    assert all(torch.isfinite(getattr(found, f.name)).all() for f in fields(found))
    hips_near = found.seed[:, 0].unflatten(-1, (-1, 3))[..., :2].mean(1).norm(dim=-1)
    assert hips_near.max() < 0.5  # canonical: the origin lies under the hips
    assert found.target_speed.max() > 0.5  # somebody walks
    again = visit(SHIPPED, agents=4, seconds=6.0, candidates=1, seed=0)
    assert torch.equal(found.seed, again.seed)


def test_commands_are_of_every_kind_and_can_be_given():
    random, agent = np.random.default_rng(0), SimpleNamespace(position=(1.0, 2.0, 0.0))
    goals = [command(agent, random) for _ in range(200)]
    for goal in goals:
        check_goal(goal, agent.position, Limits())
    assert any(goal.strafe for goal in goals) and any(not goal.stop for goal in goals)
    assert any(goal.heading is not None and not goal.strafe for goal in goals)
    assert any(goal.position[:2] == (1.0, 2.0) for goal in goals)


def test_a_folder_is_written_and_read(tmp_path):
    heard = []
    counts = write_visited(
        SHIPPED, tmp_path / "asked", 4, 8.0, 3, lambda done, total: heard.append((done, total))
    )
    assert tuple(len(part) for part in load_visited(tmp_path / "asked")) == counts
    assert heard == sorted(heard) and heard[-1][1] == 10.0
    with pytest.raises(ArtifactError, match="wayfarer train visit"):
        load_visited(tmp_path)


def test_rows_can_be_taken_and_joined():
    rows = torch.arange(6.0)
    asked = Visited(*(rows[:, None].repeat(1, BETAS) for _ in range(6)), rows)
    some = asked[torch.tensor([4, 1])]
    assert len(some) == 2 and some.manner.tolist() == [4, 1]
    assert Visited.joined([some, asked[:1]]).manner.tolist() == [4, 1, 0]
