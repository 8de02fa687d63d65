"""Copies at the neighbour, each second: whole states, and new parts of logs."""

import asyncio
from types import SimpleNamespace

import pytest

from tests.cluster.nodes import info
from wayfarer.cluster import replicas, replication
from wayfarer.cluster.replicas import Replicas
from wayfarer.cluster.replication import Replication
from wayfarer.errors import Unavailable
from wayfarer.runtime.persistence.log_copy import Replica
from wayfarer.runtime.persistence.record import UNCOPIED, LogMark

SESSION = "session-00ff34"


OTHERS = tuple(f"session-00ee{number}" for number in range(10, 14))


class Recorded:
    """Sessions of one node: one, with a log of numbers."""

    scenes = ()

    def __init__(self):
        self.sessions = [SESSION]
        self.state, self.log_id, self.entries = 0, "a", ["0"]
        self.broken = None

    def is_movable(self, name):
        return True

    async def replica(self, name, mark):
        self.state += 1
        state = str(self.state).encode()
        if name == self.broken:
            raise KeyError(name)
        if mark is None or name != SESSION:
            return Replica(state)
        mark = mark if mark.log_id == self.log_id else UNCOPIED
        part = ",".join(self.entries[mark.tracks :]).encode()
        return Replica(state, part, LogMark(self.log_id, len(self.entries), {}))


class Neighbours:
    """They keep what they are sent, unless they are away."""

    def __init__(self):
        self.kept = {"n2": Replicas(), "n3": Replicas()}
        self.away = self.forgets = self.broken = False
        self.refuses = None

    async def call(self, node, verb, owner, told, seconds=0):
        return getattr(self, verb)(self.kept[node.name], owner, told)

    def keep(self, kept, owner, copies):
        if self.away:
            raise Unavailable("away")
        if self.forgets:
            kept.renew(owner, set())
            self.forgets = False
        return {
            name: "too large" if name == self.refuses else kept.keep(owner, name, *copy)
            for name, copy in copies.items()
        }

    def present(self, kept, owner, names):
        if self.broken:
            raise KeyError("a bug")
        kept.renew(owner, set(names))

    def log(self, name="n2"):
        """The session's log at the neighbour."""
        [kept] = self.kept[name]._kept.values()
        return b",".join(kept.log_parts).decode().split(",") if kept.log_parts else None


@pytest.fixture
async def copies(monkeypatch):
    monkeypatch.setattr(replication, "REPLICATE_S", 0.01)
    nodes = {name: info(name) for name in ("n1", "n2", "n3")}
    tenancy = SimpleNamespace(
        node=nodes["n1"], view=SimpleNamespace(nodes=nodes), may_step=lambda: True
    )
    made = SimpleNamespace(moves=Recorded(), peers=Neighbours())
    made.work = Replication(tenancy, made.moves, made.peers)
    made.work.neighbour = "n2"

    async def rounds(count=3):
        wanted = made.moves.state + count
        async with asyncio.timeout(5):
            while made.moves.state < wanted:
                await asyncio.sleep(0.005)

    made.rounds = rounds
    running = asyncio.create_task(made.work.running())
    yield made
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)


async def test_a_log_grows_by_what_is_new(copies):
    for number in range(1, 4):
        await copies.rounds()
        copies.moves.entries.append(str(number))
    await copies.rounds()
    assert copies.peers.log() == ["0", "1", "2", "3"]


async def test_after_a_failure_and_after_a_loss_it_is_sent_whole_again(copies):
    await copies.rounds()
    copies.peers.away = True
    copies.moves.entries.append("1")
    await copies.rounds()
    copies.peers.away = False
    await copies.rounds()
    assert copies.peers.log() == ["0", "1"]
    copies.peers.forgets = True
    copies.moves.entries.append("2")
    await copies.rounds()
    assert copies.peers.log() == ["0", "1", "2"]


async def test_a_new_neighbour_gets_all_of_it(copies):
    copies.moves.entries.append("1")
    await copies.rounds()
    copies.work.neighbour = "n3"
    await copies.rounds()
    assert copies.peers.log("n3") == ["0", "1"]


async def test_a_log_that_begins_again_under_the_same_id_replaces_the_one_before(copies):
    copies.moves.entries += ["1", "2"]
    await copies.rounds()
    copies.moves.log_id, copies.moves.entries = "b", ["new"]
    await copies.rounds()
    assert copies.peers.log() == ["new"]


@pytest.mark.parametrize("trouble", ["refused", "broken"])
async def test_one_that_is_not_kept_does_not_stop_the_others(copies, caplog, trouble):
    copies.moves.sessions = [*OTHERS, SESSION]
    await copies.rounds(10)
    if trouble == "refused":
        copies.peers.refuses = OTHERS[1]
    else:
        copies.moves.broken = OTHERS[1]
    copies.moves.sessions.remove(OTHERS[0])
    before = copies.moves.state + 10
    await copies.rounds(30)
    kept = copies.peers.kept["n2"]._kept
    assert kept.keys() == {*OTHERS[1:], SESSION}, "who has ended is known, too"
    assert all(int(kept[name].state) > before for name in (*OTHERS[2:], SESSION))
    assert OTHERS[1] in caplog.text


async def test_a_round_that_fails_is_not_the_last_one(copies, caplog):
    await copies.rounds()
    copies.peers.broken = True
    async with asyncio.timeout(5):
        while "a round of copies failed" not in caplog.text:
            await asyncio.sleep(0.005)
    copies.peers.broken = False
    copies.moves.entries.append("1")
    await copies.rounds()
    assert copies.peers.log() == ["0", "1"]


@pytest.mark.parametrize(
    ("where", "limit"), [(replicas, "LOG_BYTES"), (replication, "LOG_PART_BYTES")]
)
async def test_where_a_log_has_no_room_the_state_is_kept_all_the_same(
    copies, monkeypatch, caplog, where, limit
):
    monkeypatch.setattr(where, limit, 0)
    copies.work.neighbour = "n3"
    await copies.rounds()
    before = copies.moves.state
    await copies.rounds()
    assert copies.peers.log("n3") is None
    [kept] = copies.peers.kept["n3"]._kept.values()
    assert int(kept.state) > before
    assert caplog.text.count("log not copied") == 1
