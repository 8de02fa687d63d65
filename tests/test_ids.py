from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.ids import SLOTS, agent_id, any_slot, scene_id, session_id, slot_of


@given(st.integers(0, SLOTS - 1))
def test_ids_say_in_which_slot_they_are(slot):
    session = session_id(slot)
    assert slot_of(session) == slot_of(agent_id(session)) == slot_of(scene_id(slot)) == slot


def test_ids_are_not_drawn_twice():
    drawn = {session_id(any_slot()) for _ in range(2000)}
    assert len(drawn) == 2000
    assert max(Counter(name[8:12] for name in drawn).values()) < 20, "slots are spread"


@pytest.mark.parametrize("name", ["", "session-", "agent-xyz", "session-1", "é" * 90, "agent-ABCD"])
def test_what_is_no_id_has_a_slot_too(name):
    assert slot_of(name) == 0


def test_agents_of_a_session_with_another_name_are_found_with_it():
    assert slot_of(agent_id("mine")) == slot_of("mine") == 0
