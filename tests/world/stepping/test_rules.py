"""The laboratory's switch: rules that are off do nothing, and watchers are called in order."""

from dataclasses import replace

import numpy as np
import pytest

from tests.world.fakes import BODIES, GOAL, FakeEngine, start_poses
from wayfarer.errors import InvalidArgument
from wayfarer.spec import NEW_FRAMES, POSED_JOINTS
from wayfarer.world.agents.agent import AgentSpec, MotionChunk, SessionSpec
from wayfarer.world.goals.commands import Path
from wayfarer.world.stepping.rules import MODEL, PLANNED, RULES, ActingRules
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

ALONE = frozenset(RULES)


def walked(rules: ActingRules, seconds: float = 4.0) -> list[MotionChunk]:
    """The chunks of an agent that stands for 2 s and then walks."""
    world = World(FakeEngine(), BODIES, start_poses(), WorldSettings(phases=1, rules=rules))
    session = world.create_session(SessionSpec(), 0.0).session_id
    [agent] = world.create_agents(session, [AgentSpec()], 0.0)
    sent = list(world.advance(seconds / 2))
    world.give(agent.agent_id, Path((replace(GOAL, speed=1.0),)), seconds / 2)
    return sent + list(world.advance(seconds))


def test_without_rules_the_model_is_sent_as_it_is() -> None:
    told: dict[str, list[np.ndarray]] = {}

    def watch(name: str, slots: np.ndarray, hips: np.ndarray, turns: np.ndarray) -> None:
        assert hips.shape == (1, NEW_FRAMES, 3) and turns.shape == (1, NEW_FRAMES, POSED_JOINTS, 4)
        told.setdefault(name, []).append(hips[0].copy())

    sent = walked(ActingRules(ALONE, watch))
    assert set(told) == {MODEL, PLANNED}
    made = {frames.tobytes() for frames in told[MODEL]}
    assert sent and all(np.asarray(c.translation).tobytes() in made for c in sent[1:])


def test_every_rule_that_acts_is_told_in_its_order() -> None:
    told: list[str] = []
    walked(ActingRules(watch=lambda name, *_: told.append(name)))
    first = told.index(PLANNED)
    assert told[:first] == [MODEL, *(name for name in RULES if name in told[:first])]
    assert "foot lock" in told[:first]


@pytest.mark.parametrize("name", ["guards", "foot lock"])
def test_a_rule_that_is_off_is_not_told(name: str) -> None:
    told: list[str] = []
    walked(ActingRules(frozenset({name}), lambda rule, *_: told.append(rule)))
    assert name not in told and len(set(told)) > 2


def test_watching_changes_nothing() -> None:
    one, two = walked(ActingRules()), walked(ActingRules(watch=lambda *_: None))
    assert all(
        np.array_equal(a.translation, b.translation) and np.array_equal(a.rotations, b.rotations)
        for a, b in zip(one, two, strict=True)
    )


def test_unknown_rules_are_refused() -> None:
    with pytest.raises(InvalidArgument, match="foot lock"):
        ActingRules(frozenset({"footlock"}))
