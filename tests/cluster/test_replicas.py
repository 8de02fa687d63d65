"""Replicas that a node keeps for its neighbours."""

import pytest

from tests.world.fakes import ManualClock
from wayfarer.cluster import replicas
from wayfarer.cluster.group_map import GroupMap
from wayfarer.cluster.messages import ADOPTED, Changes
from wayfarer.cluster.replicas import CONTENT, KEPT_S, QUIET_S, Replicas
from wayfarer.errors import ResourceExhausted

SCENE, SESSION, OTHER = "scene-00ff12", "session-00ff34", "session-00ee34"


def view(groups=None, **told):
    """The owners by the directory's answer."""
    owners = {"00ff": "a", "00ee": "b"} if groups is None else groups
    made = GroupMap()
    made.take(Changes(generation=1, version=1, groups=owners, **told))
    return made


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
    clock = ManualClock(0.0)
    kept = Replicas(clock)
    kept.keep("a", SCENE + CONTENT, b"content")
    kept.keep("a", SESSION, b"1")
    kept.keep("b", OTHER, b"2")
    clock.now = KEPT_S - 1
    kept.renew("a", {SCENE})
    assert len(kept) == 2, "the session has ended"
    for _ in range(9):
        clock.now += KEPT_S
        kept.renew("a", {SCENE})
        kept.age(view())
    assert len(kept) == 2, "nobody had a lease meanwhile"
    for _ in range(round(KEPT_S)):
        clock.now += 1
        kept.renew("a", {SCENE})
        kept.age(view())
    assert list(kept.of("00ff")) == [SCENE + CONTENT] and len(kept) == 1


def test_they_get_older_where_nobody_sends_any_more():
    """Otherwise a node that was away would keep the youngest ones."""
    clock = ManualClock(0.0)
    kept = Replicas(clock)
    kept.keep("a", SESSION, b"1")
    for _ in range(round(KEPT_S)):
        clock.now += 1.0
        kept.age(view())
        assert kept.ages() == {"00ff": ("a", clock.now)}
    clock.now += 1.0
    kept.age(view())
    assert not len(kept)


@pytest.mark.parametrize(
    ("told", "is_kept"),
    [
        ({"groups": {"00ff": "a"}}, True),
        ({"groups": {"00ff": "b"}}, False),
        ({"groups": {"00ff": ADOPTED}}, True),
        ({"groups": {}}, False),
        ({"groups": {}, "settled": False}, True),
    ],
)
def test_what_has_ended_or_has_another_owner_is_dropped(told, is_kept):
    clock = ManualClock(0.0)
    kept = Replicas(clock)
    kept.keep("a", SESSION, b"1")
    kept.age(view(**told))
    assert len(kept), "the directory may not have heard of it when it answered"
    for _ in range(2):
        clock.now += QUIET_S
        kept.age(view(**told))
    assert len(kept) == is_kept


def test_there_is_a_limit(monkeypatch):
    monkeypatch.setattr(replicas, "REPLICA_BYTES", 3)
    kept = Replicas()
    kept.keep("a", SESSION, b"12")
    kept.keep("a", SESSION, b"123")
    with pytest.raises(ResourceExhausted):
        kept.keep("a", OTHER, b"1")
