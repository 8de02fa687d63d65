import random

import pytest

from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.phases import MARGIN, UNEVEN, Phases


def entered(count, genders):
    phases = Phases(count)
    for gender in genders:
        phases.enter(gender)
    return phases


def groups(phases):
    """Numbers of agents that are stepped at one moment and share a batch."""
    return [agents for phase in phases.load for agents in phase if agents]


def drawn(agents, seed, males=0.5):
    chance = random.Random(seed)
    return [int(chance.random() < males) for _ in range(agents)]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("males", [0.0, 0.2, 0.5])
def test_phases_are_filled_alike(seed, males):
    """This holds at any time, so that no moment has much more to do than the others."""
    phases = Phases(8)
    for gender in drawn(300, seed, males):
        phases.enter(gender)
        sizes = [sum(phase) for phase in phases.load]
        assert max(sizes) <= UNEVEN * min(sizes) + MARGIN + 1


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("agents", [64, 256, 1024])
def test_genders_keep_to_phases_of_their_own(seed, agents):
    """A batch has one gender; hardly one of eight phases needs two batches."""
    genders = drawn(agents, seed)
    phases = entered(8, genders)
    assert phases.by_gender == [genders.count(0), genders.count(1)]
    assert len(groups(phases)) <= 8 + 2


def test_genders_in_turn_share_no_phase():
    assert groups(entered(4, [0, 1] * 32)) == [16] * 4


def test_who_leaves_makes_room():
    phases = entered(4, [0] * 8)
    frame = phases.next_frame(2, 100)
    assert frame % NEW_FRAMES == 2 * NEW_FRAMES // 4
    phases.leave(frame, 0)
    assert phases.enter(0) == 2
