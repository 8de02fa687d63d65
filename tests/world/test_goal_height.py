"""A goal's height does not matter on the flat floor: the model was trained on goals at height 0.

Clients often send other heights: a click on a table, hips, another character's root.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.world.fakes import FakeEngine, make_world, people, populated
from wayfarer.world.agents.agent import AgentSpec, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.behaviours import (
    Follow,
    KeepAway,
    Part,
    Patrol,
    Queue,
    Routine,
    Visit,
    Wander,
)
from wayfarer.world.goals.commands import Append, Path

HIGH = Goal((0.0, 2.0, 0.9), speed=3.0)
FARTHER = Goal((1.0, 3.0, -0.5), stop=False, speed=3.0)


class Watching(FakeEngine):
    """Remembers the goals of its inputs."""

    def __init__(self):
        super().__init__()
        self.goals = []

    def step(self, gender, inputs):
        self.goals.append(inputs.goal.copy())
        return super().step(gender, inputs)


ORDERS = {
    "goal": HIGH,
    "path": Path((FARTHER, HIGH)),
    "append": Append((HIGH, FARTHER)),
    "strafe": replace(HIGH, heading=1.0, strafe=True),
    "wander": Wander((3.0, 3.0), 3.0),
    "patrol": Patrol((HIGH, FARTHER)),
    "routine": Routine((Part(Visit((HIGH,))), Part(Patrol((FARTHER, HIGH))))),
    "follow": Follow("other"),
    "keep away": KeepAway("other"),
    "queue": Queue("bar", (2.0, 2.0), 0.0),
}


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS)
def test_the_engine_is_given_goals_on_the_floor(order):
    engine = Watching()
    world = make_world(engine)
    world.create_session(SessionSpec("s"), 0.0)
    [other] = world.create_agents("s", people(1), 0.0)
    [agent] = world.create_agents("s", [AgentSpec(position=(0.0, -1.0))], 0.0)
    if isinstance(order, Follow | KeepAway):
        order = replace(order, agent_id=other.agent_id)
    world.give(other.agent_id, HIGH, 0.0)
    world.give(agent.agent_id, order, 0.0)
    for _ in world.advance(6.0):
        goal = world.get_agent(agent.agent_id).goal
        assert goal is not None and goal.position[2] == 0
    goals = np.concatenate(engine.goals)
    assert goals.shape[1] == 3 and len(np.unique(goals[:, 1])) > 1
    assert not goals[:, 2].any()


def test_a_goal_is_told_at_the_floor():
    world, [agent] = populated()
    world.give(agent, Path((HIGH, FARTHER)), 0.0)
    assert world.get_agent(agent).goal == replace(HIGH, position=(0.0, 2.0, 0.0))
