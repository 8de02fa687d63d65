from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfarer.shard import Shard, agent_id, shard_of


@given(st.integers(1, 64).flatmap(lambda n: st.tuples(st.integers(0, n - 1), st.just(n))))
def test_ids_say_where_their_session_lives(place):
    index, count = place
    shard = Shard(index, count)
    session = shard.session_id()
    assert shard_of(session, count) == index == shard_of(agent_id(session), count)
    assert shard.holds(session) and shard.holds(agent_id(session))


@given(st.integers(1, 64), st.integers(1, 64))
def test_a_session_of_another_server_has_one_place_with_all_its_agents(made_with, brought_to):
    session = Shard(made_with - 1, made_with).session_id()
    places = {shard_of(agent_id(session), brought_to) for _ in range(8)}
    assert places == {shard_of(session, brought_to)}


def test_ids_are_not_drawn_twice():
    shard = Shard(3, 64)
    drawn = {shard.session_id() for _ in range(2000)}
    assert len(drawn) == 2000
    assert max(Counter(name[8:12] for name in drawn).values()) < 20, "keys are spread"


@pytest.mark.parametrize("name", ["", "session-", "agent-xyz", "session-1", "é" * 90, "agent-ABCD"])
def test_what_is_no_id_has_a_place_too(name):
    assert shard_of(name, 7) == 0
    assert Shard(0, 7).holds(name)


def test_agents_of_a_session_with_another_name_are_found_with_it():
    assert shard_of(agent_id("mine"), 5) == shard_of("mine", 5) == 0
