"""What nodes and entries know of owners and places."""

from collections import Counter

from tests.cluster.nodes import LEASE, Bench, info
from wayfarer.cluster.group_map import MOST_PLACES, GroupMap
from wayfarer.cluster.messages import Changes
from wayfarer.cluster.placement import rendezvous


def test_a_view_follows_by_changes_or_as_a_whole():
    bench = Bench(["n0", "n1"])
    view, fresh = GroupMap(), GroupMap()
    view.take(bench.directory.look(view.seen)[1])
    for i in range(40):
        bench.new_session(f"n{i % 2}")
        bench.beat()
        changes = bench.directory.look(view.seen)[1]
        assert not changes.whole and len(changes.groups) == 1
        view.take(changes)
    bench.directory.ended("n1")
    view.take(bench.directory.look(view.seen)[1])
    fresh.take(bench.directory.look((0, 0))[1])
    assert view._owners == fresh._owners and list(view.nodes) == ["n0"]
    assert bench.directory.look(view.seen)[1] is None


def test_a_view_that_is_older_than_the_log_gets_the_whole(monkeypatch):
    bench = Bench(["n0"])
    view = GroupMap()
    view.take(bench.directory.look(view.seen)[1])
    for _ in range(9000):
        bench.directory._touch("ffff")
    assert bench.directory.look(view.seen)[1].whole


def test_a_node_knows_all_nodes_and_those_that_were():
    bench = Bench(["n0", "n1"])
    bench.beat()
    assert {place.http_port for place in bench.nodes["n0"].nodes} == {2000, 2001}
    bench.later(LEASE * 2, "n0")  # n1 has ended
    bench.add("n2")
    bench.beat("n0", "n2")
    assert {node.http_port for node in bench.nodes["n0"].view.nodes.values()} == {2000, 2002}
    assert bench.nodes["n0"].nodes[0].http_port == 2001, "oldest first"
    assert len(bench.nodes["n0"].nodes) == 3


def test_places_of_nodes_are_bounded():
    view = GroupMap()
    for number in range(MOST_PLACES + 9):
        view.take(Changes(generation=1, version=number, nodes=(info(f"n{number}"),)))
    assert [place.worker for place in view.places] == list(range(9, MOST_PLACES + 9))
    assert len(view._places) == MOST_PLACES


def test_rendezvous_moves_only_what_it_must():
    names = [f"n{i}" for i in range(5)]
    before = {group: rendezvous(f"{group:012x}", names) for group in range(2000)}
    after = {group: rendezvous(f"{group:012x}", names[:-1]) for group in range(2000)}
    assert all(after[s] == before[s] for s in before if before[s] != "n4")
    assert min(Counter(before.values()).values()) > 300
    assert rendezvous("1", []) == ""
