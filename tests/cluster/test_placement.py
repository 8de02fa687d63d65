"""The node that a new session gets."""

from collections import Counter

import pytest

from tests.cluster.nodes import Bench
from wayfarer.cluster.messages import NodeLoad
from wayfarer.errors import Unavailable


@pytest.mark.parametrize("gap", [0.005, 0.05, 0.5])
def test_placement_spreads_sessions_that_hold_nobody_yet(gap):
    """However fast they come, and though nodes report at different times."""
    bench = Bench(["n0", "n1", "n2"])
    placed = Counter()
    reports_at = {name: bench.now + 0.08 * i for i, name in enumerate(bench.nodes)}
    for _ in range(60):
        bench.now += gap
        for name, at in reports_at.items():
            if at <= bench.now:
                bench.loads[name] = NodeLoad(sessions=placed[name])
                bench.beat(name)
                reports_at[name] = bench.now + 0.25
        placed[bench.directory.place().name] += 1
    assert max(placed.values()) - min(placed.values()) <= 4, placed


def test_sessions_that_were_placed_and_never_made_are_forgotten():
    bench = Bench(["n0", "n1"])
    bench.directory.drain("n1")
    for _ in range(5):
        assert bench.directory.place().name == "n0"
    bench.add("n2")
    bench.loads["n2"] = NodeLoad(sessions=3)
    bench.beat()
    assert bench.directory.place().name == "n2"
    bench.later(2.5, "n0", "n1", "n2")
    assert bench.directory.place().name == "n0"


def test_placement_prefers_free_capacity_not_few_people():
    bench = Bench(["n0"])
    bench.add("n1", capacity=1000)
    bench.loads |= {"n0": NodeLoad(agents=50, sessions=5), "n1": NodeLoad(agents=60, sessions=6)}
    bench.beat()
    assert bench.directory.place().name == "n1"


def test_a_create_sent_twice_goes_to_the_same_node():
    bench = Bench(["n0", "n1", "n2"])
    assert len({bench.directory.place("digest").name for _ in range(9)}) == 1


def test_a_create_sent_again_goes_to_the_owner_of_what_it_has_made():
    bench = Bench(["n0", "n1", "n2"])
    group = bench.new_session("n1")
    bench.beat()
    assert {bench.directory.place(group).name for _ in range(9)} == {"n1"}
    bench.directory.ended("n1")
    with pytest.raises(Unavailable, match="ended; ask again"):
        bench.directory.place(group)
    heir = bench.owner(group)
    bench.adopt(heir, bench.beat(heir)[heir].orders[0])
    assert {bench.directory.place(group).name for _ in range(9)} == {heir}
    again = Bench(["n0"], settled=False)
    assert again.directory.place().name == "n0"
    with pytest.raises(Unavailable, match="come back"):
        again.directory.place(group)  # its owner may still tell


def test_nothing_is_placed_where_nothing_is_taken():
    bench = Bench()
    with pytest.raises(Unavailable, match="none is registered"):
        bench.directory.place()
    bench.add("n0")
    bench.loads["n0"] = NodeLoad(ready=False)
    bench.beat()
    with pytest.raises(Unavailable, match="1 starting or full"):
        bench.directory.place()


def test_only_nodes_of_one_model_get_new_sessions():
    bench = Bench(["n0", "n1"])
    bench.add("n2", fingerprint="b")
    assert {bench.directory.place().name for _ in range(30)} == {"n0", "n1"}
    bench.directory.drain("n0")
    bench.add("n3", fingerprint="b")
    assert {bench.directory.place().name for _ in range(30)} == {"n2", "n3"}
