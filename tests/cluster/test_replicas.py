"""Replicas that a node keeps for its neighbours."""

import pytest

from wayfarer.cluster import replicas
from wayfarer.cluster.replicas import CONTENT, KEPT_S, Replicas
from wayfarer.errors import ResourceExhausted

SCENE, SESSION, OTHER = "scene-00ff12", "session-00ff34", "session-00ee34"


def test_a_scene_comes_with_its_content_and_its_sessions():
    kept = Replicas()
    for name in (SCENE + CONTENT, SCENE, SESSION, OTHER):
        kept.keep("a", name, name.encode())
    found = {name: replica.state for name, replica in kept.of("00ff").items()}
    assert found == {name: name.encode() for name in (SCENE + CONTENT, SCENE, SESSION)}
    assert len(kept) == 4, "until it is known that they are not needed any more"
    kept.drop("00ff")
    assert len(kept) == 1 and kept.of("00ff") == {}


def test_what_its_owner_does_not_have_any_more_is_dropped_and_content_stays_with_its_scene():
    now = [0.0]
    kept = Replicas(lambda: now[0])
    kept.keep("a", SCENE + CONTENT, b"content")
    kept.keep("a", SESSION, b"1")
    kept.keep("b", OTHER, b"2")
    now[0] = KEPT_S - 1
    kept.renew("a", {SCENE})
    assert len(kept) == 2, "the session has ended"
    now[0] = KEPT_S + 1
    kept.renew("a", {SCENE})
    assert list(kept.of("00ff")) == [SCENE + CONTENT] and len(kept) == 1


def test_there_is_a_limit(monkeypatch):
    monkeypatch.setattr(replicas, "REPLICA_BYTES", 3)
    kept = Replicas()
    kept.keep("a", SESSION, b"12")
    kept.keep("a", SESSION, b"123")
    with pytest.raises(ResourceExhausted):
        kept.keep("a", OTHER, b"1")


def logs_of(kept):
    return {name: replica.log_parts for name, replica in kept.of("00ff").items()}


def test_the_parts_of_a_log_gather_while_its_state_is_replaced():
    kept = Replicas()
    assert kept.keep("a", SESSION, b"1", b"x") == 1
    assert kept.keep("a", SESSION, b"2", b"", 1) == 1
    assert kept.keep("a", SESSION, b"3", b"y", 1) == 2
    [replica] = kept.of("00ff").values()
    assert (replica.state, replica.log_parts) == (b"3", [b"x", b"y"])


def test_where_parts_are_missing_the_log_is_asked_for_again_and_the_state_is_kept():
    kept = Replicas()
    assert kept.keep("a", SESSION, b"1", b"z", 2) == 0
    assert len(kept) == 1
    assert kept.keep("a", SESSION, b"2", b"x") == 1
    assert kept.keep("a", SESSION, b"3", b"x") == 1, "from its beginning"
    assert logs_of(kept) == {SESSION: [b"x"]}


def test_logs_have_a_limit_of_their_own(monkeypatch):
    monkeypatch.setattr(replicas, "LOG_BYTES", 2 * (replicas.PART_BYTES + 1))
    kept = Replicas()
    assert kept.keep("a", SCENE, b"1", b"x") == 1
    assert kept.keep("a", SESSION, b"1", b"x") == 1
    assert kept.keep("a", SESSION, b"2", b"y", 1) == 0
    assert logs_of(kept) == {SCENE: [b"x"], SESSION: []}
