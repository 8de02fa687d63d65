from hypothesis import given
from hypothesis import strategies as st

from wayfarer.endpoint import Endpoint
from wayfarer.ids import agent_id, session_id, slot_of
from wayfarer.workers.shares import WorkerShares, worker_of


def shares(index: int, count: int) -> WorkerShares:
    return WorkerShares(index, [Endpoint(i, 50052 + i, 8081 + i) for i in range(count)])


@given(st.integers(1, 64).flatmap(lambda n: st.tuples(st.integers(0, n - 1), st.just(n))))
def test_new_sessions_live_where_they_were_made(place):
    index, count = place
    here = shares(index, count)
    session = session_id(here.new_key())
    assert worker_of(session, count) == index == worker_of(agent_id(session), count)
    assert here.endpoint_of(session) is here.endpoint_of(agent_id(session)) is None
    for other in range(count):
        if other != index:
            assert shares(other, count).endpoint_of(session) == here.own


@given(st.integers(0, 65535), st.integers(1, 64))
def test_a_session_of_another_server_has_one_place_with_all_its_agents(slot, brought_to):
    session = session_id(slot)
    places = {worker_of(agent_id(session), brought_to) for _ in range(8)}
    assert places == {worker_of(session, brought_to)} == {slot_of(session) % brought_to}


def test_what_is_no_id_has_a_place_too():
    assert shares(0, 7).endpoint_of("nonsense") is None
