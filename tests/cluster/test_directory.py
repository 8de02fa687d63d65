"""The directory: owners of groups, adoptions and drains."""

import asyncio

import pytest

from tests.cluster import virtual_time
from tests.cluster.nodes import LEASE, Bench, coming, info, named, owner, renewal
from tests.world.fakes import ManualClock
from wayfarer.cluster.directory import AWAY_S, DRIFT, SHARES, Directory, LeaseRules
from wayfarer.cluster.group_map import GroupMap
from wayfarer.cluster.messages import ADOPTED, SILENT_S, Answer, NodeLoad
from wayfarer.cluster.node_lease import CLAIM_S, NodeLease
from wayfarer.errors import Aborted, FailedPrecondition, NotFound, Unavailable


def test_what_is_made_on_a_node_is_its_own():
    bench = Bench(["n0", "n1"])
    groups = [bench.new_session(name) for name in ("n0", "n0", "n1")]
    assert bench.nodes["n0"].endpoint_of(named(groups[0])) is None, "it is here already"
    bench.beat()
    assert len(set(groups)) == 3
    owners = [bench.owner(group) for group in groups]
    assert owners == ["n0", "n0", "n1"]


def test_what_was_made_is_answered_once_the_directory_knows_it():
    bench = Bench(["n0"])
    node, group = bench.nodes["n0"], bench.new_session("n0")

    async def main():
        claiming = asyncio.create_task(node.claimed(named(group)))
        await asyncio.sleep(0)
        assert node.unclaimed.is_set() and not claiming.done()
        bench.beat()
        await claiming
        assert bench.owner(group) == "n0"
        began = asyncio.get_running_loop().time()
        await node.claimed(named("abcdef012345"))  # the directory is away
        return asyncio.get_running_loop().time() - began

    assert virtual_time.run(main()) == pytest.approx(CLAIM_S)


def test_groups_without_sessions_are_given_back():
    bench = Bench(["n0"])
    group = bench.new_session("n0")
    bench.beat()
    bench.present["n0"].clear()
    bench.beat()
    assert bench.nodes["n0"].epoch(named(group)) == 0
    assert bench.status.nodes[0].groups == 0
    bench.present["n0"].add(group)  # as by a snapshot of what lived there
    bench.beat()
    assert bench.owner(group) == "n0" and bench.nodes["n0"].epoch(named(group))


def test_a_report_whose_answer_was_lost_is_repeated_and_changes_nothing():
    bench = Bench(["n0"])
    group = bench.new_session("n0")
    answers = []
    for _ in range(2):
        told = bench.nodes["n0"].renewal(NodeLoad(), bench.present["n0"])
        assert set(told.held) == {group}
        answers.append(bench.directory.renew(told))
    assert answers[0].epochs == answers[1].epochs != {}
    bench.beat()
    told = [bench.nodes["n0"].renewal(NodeLoad(), bench.present["n0"]).held for _ in range(SHARES)]
    assert sorted(map(len, told)) == [0] * (SHARES - 1) + [1], "as any that it holds, from now on"


def test_a_report_that_comes_after_its_successor_is_not_heard():
    bench = Bench(["n0"])
    node = bench.nodes["n0"]
    old = node.renewal(NodeLoad(agents=1), ())
    new = node.renewal(NodeLoad(agents=2), ())
    bench.directory.renew(new)
    bench.now += 1
    answer = bench.directory.renew(old)
    assert answer.lease_s == 0
    assert bench.status.agents == 2


def test_replicas_go_to_a_neighbour_with_the_same_model_that_stays():
    bench = Bench(["n0", "n1", "n2"])
    bench.add("n3", fingerprint="b")
    before = {name: answer.neighbour for name, answer in bench.beat().items()}
    assert before["n3"] == ""
    assert all(before[name] not in (name, "n3", "") for name in ("n0", "n1", "n2"))
    bench.add("n4")
    assert {n: a.neighbour for n, a in bench.beat("n0", "n1", "n2").items()} == {
        n: before[n] for n in ("n0", "n1", "n2")
    }


def test_the_groups_of_a_dead_node_are_adopted_by_its_neighbour():
    bench = Bench(["n0", "n1", "n2"])
    group = bench.new_session("n0")
    neighbour = bench.beat()["n0"].neighbour
    epoch = bench.nodes["n0"].epoch(named(group))
    bench.directory.ended("n0")
    order = bench.beat(neighbour)[neighbour].orders[0]
    assert (order.kind, order.group) == ("adopt", group) and order.epoch > epoch
    assert bench.beat(neighbour)[neighbour].orders == (order,)  # until it is done
    assert bench.nodes[neighbour].owes(order)
    bench.adopt(neighbour, order)
    assert not bench.nodes[neighbour].owes(order), "an answer from before may repeat it"
    assert bench.beat(neighbour)[neighbour].orders == ()
    assert bench.owner(group) == neighbour
    assert bench.directory.counters["adopted"] == 1


def test_where_no_replica_is_the_group_goes_to_who_may_have_an_older_one_and_is_lost_at_last():
    bench = Bench(["n0", "n1", "n2"])
    group = bench.new_session("n0")
    first = bench.beat()["n0"].neighbour
    second = ({"n1", "n2"} - {first}).pop()
    bench.directory._nodes["n0"].keepers = (first, second)
    bench.directory.ended("n0")
    for keeper in (first, second):
        (order,) = bench.beat(keeper)[keeper].orders
        assert order.group == group and bench.nodes[keeper].owes(order)
        bench.directory.decline(group, keeper, order.epoch, "")
        assert bench.beat(keeper)[keeper].orders == ()
    assert bench.directory.counters["lost"] == 1
    assert group not in bench.directory._groups


def test_an_adoption_declined_again_does_not_end_a_later_one():
    bench = Bench(["n0", "n1", "n2"])
    group = bench.new_session("n0")
    first = bench.beat()["n0"].neighbour
    second = ({"n1", "n2"} - {first}).pop()
    bench.directory.ended("n0")
    told = []
    for name, to in ((first, second), (second, first)):  # each hands it on to the other
        (order,) = bench.beat(name)[name].orders
        told.append((group, name, order.epoch, to))
        bench.directory.decline(*told[-1])
    for again in told:  # the answer was lost
        with pytest.raises(Aborted):
            bench.directory.decline(*again)
    (order,) = bench.beat(first)[first].orders
    assert order.group == group and bench.owner(group) == first


def test_a_message_that_comes_after_the_end_of_its_node_enters_nobody():
    bench = Bench(["n0", "n1"])
    late = coming("n0", count=99)
    bench.directory.ended("n0")
    assert bench.directory.renew(late) == Answer()
    assert [one.node.name for one in bench.status.nodes] == ["n1"]


def test_an_adopter_that_dies_too_hands_on_to_its_own_neighbour():
    bench = Bench(["n0", "n1", "n2"])
    group = bench.new_session("n0")
    first = bench.beat()["n0"].neighbour
    second = ({"n1", "n2"} - {first}).pop()
    bench.directory.ended("n0")
    order = bench.beat(first)[first].orders[0]
    bench.adopt(first, order)
    bench.beat()
    bench.directory.ended(first)
    assert [o.group for o in bench.beat(second)[second].orders] == [group]


def test_a_silent_node_is_fenced_after_its_own_lease_has_ended():
    bench = Bench(["n0", "n1"])
    group = bench.new_session("n0")
    bench.beat()
    bench.later(LEASE, "n1")
    assert not bench.nodes["n0"].may_step()
    assert bench.owner(group) == "n0"
    bench.later(LEASE * (DRIFT - 1) + 0.25, "n1")
    assert bench.owner(group) == "n1"
    bench.adopt("n1", bench.beat("n1")["n1"].orders[0])
    assert bench.beat("n0")["n0"].fenced
    assert bench.beat("n0")["n0"].lost == (group,)
    assert not bench.nodes["n0"].may_step()  # the lost group is still there
    bench.nodes["n0"].released(group)
    assert bench.nodes["n0"].may_step()


def test_what_a_silent_node_without_keepers_may_have_is_nobodys_only_once_it_cannot_come_back():
    """All nodes were silent for longer than a lease; they come back one after the other."""

    def silent():
        bench = Bench(["n0", "n1"])
        group = bench.new_session("n0")
        bench.beat()
        view = GroupMap()
        view.take(bench.directory.look(view.seen)[1])
        bench.later(25.0)
        bench.beat("n1")
        bench.beat("n1")
        return bench, group, view

    def found(bench, group, view):
        view.take(bench.directory.look(view.seen)[1])
        return view.owner(named(group))

    bench, group, view = silent()
    for reader in (view, GroupMap()):  # that of an entry that starts, too
        with pytest.raises(Unavailable, match="silent"):
            found(bench, group, reader)
    with pytest.raises(Unavailable, match="silent"):
        bench.directory.place(group)
    with pytest.raises(Unavailable, match="silent"):
        bench.nodes["n1"].endpoint_of(named(group))
    bench.beat("n0")
    bench.beat("n0")
    assert found(bench, group, view).name == bench.owner(group) == "n0"
    assert not bench.directory.counters["lost"] and not bench.directory._missing

    bench, group, view = silent()
    bench.present["n0"].clear()  # it has been deleted there meanwhile
    bench.beat("n0")
    bench.beat("n0")
    assert found(bench, group, view) is None

    bench, group, view = silent()
    bench.directory.ended("n0")
    assert found(bench, group, view) is None and bench.directory.counters["lost"] == 1

    bench, group, view = silent()
    bench.later(AWAY_S - 5, "n1")
    with pytest.raises(Unavailable):
        found(bench, group, view)
    bench.later(10, "n1")
    assert found(bench, group, view) is None and not bench.directory._away


def test_a_directory_that_starts_does_not_say_that_anything_does_not_exist():
    bench = Bench(["n0"], settled=False)
    group = bench.new_session("n0")
    bench.beat()
    node, gone = bench.nodes["n0"], "f" * 12
    assert node.endpoint_of(named(group)) is None, "it is here"
    with pytest.raises(Unavailable, match="not all nodes"):
        node.endpoint_of(named(gone))
    bench.later(LEASE * DRIFT + 0.25, "n0")
    assert node.endpoint_of(named(gone)) is None


def test_a_silent_node_may_be_ended_while_another_has_its_copies():
    bench, told = Bench(), {}
    bench.directory._watch = lambda node: lambda forsaken: told.update({node.name: forsaken})
    bench.add("n0")
    bench.later(SILENT_S + 0.25)
    bench.directory.expire()
    assert told == {"n0": False}, "no other node has its sessions"
    bench.add("n1")
    bench.beat()
    bench.beat()
    bench.later(SILENT_S + 0.25, "n1")
    assert told == {"n0": True, "n1": False}
    bench.beat()
    bench.now += SILENT_S + 0.25  # the directory itself was stopped, as all of the machine
    bench.beat("n0")
    assert told == {"n0": False, "n1": False}


def test_a_drained_node_moves_what_it_has_and_is_done():
    bench = Bench(["n0", "n1", "n2"])
    groups = {bench.new_session("n0") for _ in range(6)}
    bench.beat()
    bench.directory.drain("n0")
    moved = set()
    while not (answer := bench.beat("n0")["n0"]).done:
        assert answer.orders and answer.draining
        for order in answer.orders:
            epoch = bench.directory.claim(order.group, "n0", order.epoch, order.to)
            bench.nodes["n0"].decided(order.group, 0)
            bench.present["n0"].discard(order.group)
            bench.nodes[order.to].decided(order.group, epoch)
            bench.present[order.to].add(order.group)
            moved.add(order.group)
    assert moved == groups
    assert {bench.owner(group) for group in groups} == {"n1", "n2"}


def test_a_drain_that_nobody_could_take_over_is_refused():
    bench = Bench(["n0"])
    bench.new_session("n0")
    bench.beat()
    with pytest.raises(FailedPrecondition, match="no other node"):
        bench.directory.drain("n0")
    with pytest.raises(NotFound, match="there are n0"):
        bench.directory.drain("n7")


def test_a_claim_needs_owner_and_epoch_as_they_are():
    bench = Bench(["n0", "n1"])
    bench.add("n2", fingerprint="b")
    group = bench.new_session("n0")
    bench.beat()
    epoch = bench.nodes["n0"].epoch(named(group))
    directory = bench.directory
    for giver, wrong in (("n1", epoch), ("n0", epoch - 1)):
        with pytest.raises(Aborted):
            directory.claim(group, giver, wrong, "n1")
    with pytest.raises(FailedPrecondition, match="another model"):
        directory.claim(group, "n0", epoch, "n2")
    new = directory.claim(group, "n0", epoch, "n1")
    assert new > epoch
    assert directory.claim(group, "n0", epoch, "n1") == new, "the answer was lost"
    with pytest.raises(Unavailable, match="on its way to n1"):
        directory.claim(group, "n0", epoch, "n0")
    bench.present["n1"] = {group}
    bench.nodes["n1"].decided(group, new)
    bench.beat("n1")
    with pytest.raises(Aborted):  # n1 has heard that it has it
        directory.claim(group, "n0", epoch, "n0")
    assert directory.counters["moved"] == 1


def test_an_owner_that_keeps_a_group_takes_the_offer_back():
    bench = Bench(["n0", "n1"])
    group = bench.new_session("n0")
    bench.beat()
    epoch, directory = bench.nodes["n0"].epoch(named(group)), bench.directory
    kept = directory.claim(group, "n0", epoch, "n0")
    assert kept > epoch and directory.claim(group, "n0", epoch, "n0") == kept
    with pytest.raises(Aborted):
        directory.claim(group, "n0", epoch, "n1")
    assert directory.claim(group, "n0", kept, "n1") > kept


def test_a_directory_that_does_not_know_all_decides_no_move():
    bench = Bench(["n0", "n1"])
    group = bench.new_session("n0")
    bench.beat()
    epoch = bench.nodes["n0"].epoch(named(group))
    given = bench.directory.claim(group, "n0", epoch, "n1")
    bench.nodes["n1"].decided(group, given)
    bench.present = {"n0": {group}, "n1": {group}}
    bench.nodes["n0"].going(group)
    bench.directory = Directory(LeaseRules(LEASE), given + 1000, lambda: bench.now, seed=1)
    bench.beat()  # fenced
    bench.beat("n0")
    with pytest.raises(Unavailable):
        bench.directory.claim(group, "n0", epoch, "n0")
    bench.later(LEASE * DRIFT + 0.5, "n1", "n0")
    with pytest.raises(Aborted, match="n1's"):
        bench.directory.claim(group, "n0", epoch, "n0")


def test_who_gave_a_group_to_a_node_that_died_with_it_may_still_have_it():
    bench = Bench(["n0", "n1", "n2"])
    group = bench.new_session("n0")
    bench.beat()
    epoch, directory = bench.nodes["n0"].epoch(named(group)), bench.directory
    directory.claim(group, "n0", epoch, "n1")
    directory._nodes["n1"].keepers = ("n2",)
    directory.ended("n1")
    with pytest.raises(Unavailable, match="adopted by n2"):
        directory.claim(group, "n0", epoch, "n0")
    directory.decline(group, "n2", directory._groups[group].epoch, "")
    assert directory.claim(group, "n0", epoch, "n0") > epoch
    assert not bench.beat("n0")["n0"].orders and not directory.counters["lost"]


@pytest.mark.parametrize("declined", [False, True])
def test_who_has_taken_a_group_gets_it_when_its_giver_dies_before_that_is_decided(declined):
    bench = Bench(["n0", "n1", "n2"])
    group = bench.new_session("n0")
    bench.beat()
    epoch, directory = bench.nodes["n0"].epoch(named(group)), bench.directory
    directory._nodes["n0"].keepers = ("n2", "n1")
    directory.ended("n0")
    if declined:
        directory.decline(group, "n2", directory._groups[group].epoch, "")
    adopter = bench.owner(group), directory._groups[group].epoch
    given = directory.claim(group, "n0", epoch, "n1")
    assert given == directory.claim(group, "n0", epoch, "n1") and bench.owner(group) == "n1"
    assert not bench.beat("n1")["n1"].orders
    with pytest.raises(Aborted):
        directory.claim(group, "n2", adopter[1], "n2")


def test_a_node_that_was_silent_gets_back_what_is_still_being_adopted():
    bench = Bench(["n0", "n1"])
    group = bench.new_session("n0")
    bench.beat()
    bench.later(LEASE * DRIFT + 0.25, "n1")
    (order,) = bench.beat("n1")["n1"].orders
    bench.beat("n0")
    assert not bench.beat("n0")["n0"].lost and bench.nodes["n0"].may_step()
    assert bench.nodes["n0"].epoch(named(group)) > order.epoch
    with pytest.raises(Aborted):
        bench.directory.claim(group, "n1", order.epoch, "n1")
    assert bench.owner(group) == "n0" and not bench.beat("n1")["n1"].orders


def test_a_node_and_the_directory_that_disagree_notice_it():
    bench = Bench(["n0", "n1"])
    other, gone = bench.new_session("n0"), bench.new_session("n0")
    bench.beat()
    directory, seconds = bench.directory, SHARES / 4
    directory._own(other, "n1")
    del bench.nodes["n0"]._held[gone]
    bench.present["n0"] = {other}
    bench.later(seconds, "n0")
    assert bench.nodes["n0"].lost == {other} and not bench.nodes["n0"].may_step()
    bench.later(0.25, "n0")
    assert gone not in directory._groups


def test_what_is_left_from_an_earlier_time_does_not_stand_for_a_replica():
    bench = Bench(["n0", "n1"])
    group = bench.new_session("n0")
    bench.beat()
    epoch = bench.nodes["n0"].epoch(named(group))
    bench.directory.claim(group, "n0", epoch, "n1")
    bench.directory.ended("n1")  # n0, which has not heard that, is to adopt it
    bench.nodes["n0"].registered = False
    answer = bench.beat("n0")["n0"]
    assert answer.lost == (group,) and [order.group for order in answer.orders] == [group]


def test_a_restarted_directory_learns_from_the_nodes_and_gives_nothing_away_meanwhile():
    bench = Bench(["n0", "n1"])
    group = bench.new_session("n0")
    bench.beat()
    epoch = bench.nodes["n0"].epoch(named(group))
    bench.directory = Directory(LeaseRules(LEASE), epoch + 1000, lambda: bench.now, seed=1)
    answers = bench.beat()
    assert all(answer.fenced for answer in answers.values())
    bench.nodes["n0"]._until = bench.now + 1.0  # the old lease still held
    answers = bench.beat()
    assert answers["n0"].lease_s == LEASE
    assert bench.owner(group) == "n0"
    assert bench.nodes["n0"].epoch(named(group)) == epoch
    bench.later(LEASE * DRIFT + 0.25, "n0", "n1")
    later = bench.new_session("n1")
    bench.beat()
    assert bench.directory._groups[group].owner == "n0"
    assert bench.nodes["n1"].epoch(named(later)) > epoch


ORPHAN = "00ff00ff00ff"


def restarted(seconds, **ages):
    """A directory, and a view of it, this long after its start; nodes came with replicas, of these
    ages, of what n0 had.
    """
    clock, view = ManualClock(0.0), GroupMap()
    directory = Directory(LeaseRules(LEASE), 1000, clock)
    for count in range(1, round(seconds * 4) + 1):
        clock.now += 0.25
        for name, age in ages.items():
            directory.renew(coming(name, kept={ORPHAN: ("n0", age)}, count=count))
        view.take(directory.look(view.seen)[1])
        with pytest.raises(Unavailable):  # no caller hears that it does not exist
            view.owner(named(ORPHAN))
        with pytest.raises(Unavailable):
            directory.place(ORPHAN)
    return directory, view


def test_what_ended_with_an_earlier_directory_is_adopted_from_the_youngest_replica():
    directory, _ = restarted(2 * LEASE, n1=1.5, n2=0.5)
    assert owner(directory, ORPHAN) is None
    directory, _ = restarted(2 * LEASE * DRIFT + 0.5, n1=1.5, n2=0.5)
    entry = directory._groups[ORPHAN]
    assert (entry.owner, entry.keepers) == ("n2", ("n1",))
    (order,) = directory.renew(renewal("n2", count=99)).orders
    assert (order.kind, order.group) == ("adopt", ORPHAN)
    again = directory.renew(coming("n0", held={ORPHAN: 9}))
    assert owner(directory, ORPHAN) == "n0" and not again.lost, "its own group is no replica"


def test_its_owner_comes_in_time_and_what_it_has_ended_is_gone():
    directory, view = restarted(LEASE * DRIFT + 0.5, n1=0.5)
    directory.renew(coming("n0"))
    view.take(directory.look(view.seen)[1])
    assert view.owner(named(ORPHAN)) is None and not directory._missing


def test_an_old_replica_is_of_what_had_ended():
    directory = Directory(LeaseRules(LEASE), 1000, lambda: 0.0)
    directory.renew(coming("n1", kept={ORPHAN: ("n0", 4 * LEASE)}))
    assert not directory._missing and not directory._away


def test_a_move_that_an_earlier_directory_decided_stays_decided():
    """The answer to the new owner was lost; the giver knows, and keeps a replica."""
    bench = Bench()
    bench.directory._settled_at = bench.now
    bench.directory.renew(coming("n1", kept={ORPHAN: ("n2", 0.5)}))
    with pytest.raises(Unavailable, match="come back"):
        bench.directory.claim(ORPHAN, "n1", 5, "n2")
    bench.directory.renew(coming("n2"))
    with pytest.raises(Aborted):
        bench.directory.claim(ORPHAN, "n1", 5, "n1")
    assert bench.directory.claim(ORPHAN, "n1", 5, "n2") and bench.owner(ORPHAN) == "n2"


def test_what_has_ended_is_nobodys_though_an_earlier_directory_had_replicas_of_it():
    """Else its giver, which waits for an answer, would get it back."""
    bench = Bench()
    bench.directory._settled_at = bench.now
    bench.directory.renew(coming("n2", kept={ORPHAN: ("n1", 0.5)}))
    bench.directory.renew(coming("n1", held={ORPHAN: 5}, leased=True))
    assert bench.owner(ORPHAN) == "n1"
    bench.directory.renew(renewal("n1", count=2, freed=(ORPHAN,)))
    with pytest.raises(Aborted):
        bench.directory.claim(ORPHAN, "n1", 5, "n1")


def test_of_two_claimants_the_greater_epoch_is_right():
    now = 0.0
    directory = Directory(LeaseRules(LEASE), 1, lambda: now)
    silent = directory.renew(coming("n0", held={"7": 5}, leased=False))
    assert silent.lease_s == 0  # its lease had ended: another may be the owner
    now = 0.2
    directory.renew(coming("n1", held={"7": 9}, leased=True))
    now = LEASE * DRIFT + 0.1
    late = directory.renew(coming("n0", held={"7": 5}, leased=False, count=2))
    assert late.lost == ("7",) and late.lease_s == LEASE
    assert owner(directory, "7") == "n1"


def test_an_imported_snapshot_claims_the_group_of_its_id():
    bench = Bench(["n0", "n1"])
    bench.present["n0"].add("abcd")
    bench.beat()
    assert bench.owner("abcd") == "n0"
    bench.present["n1"].add("abcd")
    assert bench.beat("n1")["n1"].lost == ("abcd",)


def test_what_a_node_keeps_on_disk_waits_for_its_next_life():
    bench = Bench(["n0", "n1"], settled=False, nodes=2, keep=True)
    kept, ended = bench.new_session("n0"), bench.new_session("n0")
    assert not bench.beat()["n0"].neighbour, "nobody needs a copy"
    epoch = bench.nodes["n0"].epoch(named(kept))
    bench.directory.ended("n0")
    del bench.nodes["n0"]
    bench.later(LEASE, "n1")
    for group in (kept, ended):
        with pytest.raises(Unavailable, match="has ended"):
            bench.nodes["n1"].endpoint_of(named(group))
        with pytest.raises(Unavailable, match="has ended"):
            bench.nodes["n1"].view.node_for(named(group))
    bench.present["m0"] = {kept}
    bench.add("m0", number=0)
    assert bench.nodes["m0"].epoch(named(kept)) > epoch and not bench.nodes["m0"].lost
    bench.beat()
    assert bench.nodes["n1"].endpoint_of(named(kept)).worker == 0
    assert bench.nodes["n1"].endpoint_of(named(ended)) is None, "its journal knows nothing of it"


def test_a_node_that_was_silent_gets_back_what_it_keeps():
    bench = Bench(["n0", "n1"], settled=False, nodes=2, keep=True)
    group = bench.new_session("n0")
    bench.beat()
    bench.later(2 * LEASE, "n1")
    assert [one.node.name for one in bench.status.nodes] == ["n1"]
    assert bench.beat("n0")["n0"].fenced
    bench.beat("n0")
    assert bench.nodes["n0"].may_step() and not bench.nodes["n0"].lost
    assert bench.owner(group) == "n0"


def test_nothing_is_given_away_until_all_have_told_what_they_have_kept():
    bench = Bench(settled=False, nodes=2, keep=True)
    one, two = "0123456789a7", "0123456789a8"
    bench.present["n0"] = {one}
    bench.add("n0")
    assert bench.nodes["n0"].leased and bench.nodes["n0"].epoch(named(one)) > 0
    assert not bench.status.settled
    bench.present["n1"] = {one, two}  # it was moving when all were killed
    bench.add("n1")
    assert bench.nodes["n1"].lost == {one}
    assert bench.status.settled


def test_a_directory_is_settled_once_all_nodes_take_sessions():
    """Else the first sessions would all be placed on the node that was the first."""
    bench = Bench(["n0"], settled=False, nodes=2)
    starting = bench.nodes["n1"] = NodeLease(info("n1"), lambda: bench.now)
    bench.present["n1"], bench.loads["n1"] = set(), NodeLoad(ready=False)
    bench.beat()
    assert starting.leased and not bench.status.settled
    bench.loads["n1"] = NodeLoad()
    bench.beat()
    assert bench.status.settled


def test_status_counts_room():
    bench = Bench(["n0", "n1"])
    bench.loads["n0"] = NodeLoad(agents=30, sessions=2)
    bench.beat()
    status = bench.status
    assert (status.capacity, status.agents) == (200, 30)
    bench.loads["n0"] = NodeLoad(agents=30, sessions=2, fits=40)  # it has measured
    bench.loads["n1"] = NodeLoad(fits=400)  # its limits allow 100
    bench.beat()
    assert bench.status.capacity == 140
    bench.directory.drain("n1")
    assert bench.status.capacity == 40


def test_unknown_nodes_are_fenced():
    assert Bench().directory.renew(renewal("n9")).fenced
    assert info("n9").name == "n9"


def test_a_process_that_ends_is_known_before_its_lease_ends():
    over = set()
    bench = Bench(["n0", "n1", "n2"])
    bench.directory._watch = lambda node: lambda forsaken: node.name in over
    n3, group = bench.add("n3"), None
    bench.beat()
    group = bench.new_session("n3")
    bench.beat()
    bench.beat()
    assert n3.epoch(named(group))
    over.add("n3")
    del bench.nodes["n3"]
    (order,) = [order for answer in bench.beat().values() for order in answer.orders]
    assert (order.kind, order.group) == ("adopt", group)
    told = bench.directory.look((0, 0))[1]
    assert told.groups[group] == ADOPTED, "nobody is sent there before it has come"
    adopter = bench.owner(group)
    bench.adopt(adopter, order)
    assert bench.directory.look((told.generation, told.version))[1].groups[group] == adopter
    assert not bench.directory.counters["expired"]
