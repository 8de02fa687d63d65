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
    for _ in range(9):
        now[0] += KEPT_S
        kept.renew("a", {SCENE})
    assert len(kept) == 2, "nobody had a lease meanwhile"
    for _ in range(round(KEPT_S)):
        now[0] += 1
        kept.renew("a", {SCENE})
    assert list(kept.of("00ff")) == [SCENE + CONTENT] and len(kept) == 1


def test_there_is_a_limit(monkeypatch):
    monkeypatch.setattr(replicas, "REPLICA_BYTES", 3)
    kept = Replicas()
    kept.keep("a", SESSION, b"12")
    kept.keep("a", SESSION, b"123")
    with pytest.raises(ResourceExhausted):
        kept.keep("a", OTHER, b"1")
