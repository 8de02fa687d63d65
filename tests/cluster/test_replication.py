"""What a node leaves with its neighbour, second after second: states whole, logs by what is new."""

import asyncio
from types import SimpleNamespace

import pytest

from tests.cluster.nodes import info
from wayfarer.cluster import peer, replication
from wayfarer.cluster.peer import Replicas
from wayfarer.cluster.replication import Replication
from wayfarer.errors import Unavailable
from wayfarer.service.persistence.record import LogMark
from wayfarer.service.persistence.replica import Replica

SESSION = "session-00ff34"


class Recorded:
    """Sessions of one node: one, with a log of numbers."""

    sessions, scenes = (SESSION,), ()

    def __init__(self):
        self.state, self.entries = 0, ["0"]

    def is_movable(self, name):
        return True

    async def replica(self, name, mark):
        self.state += 1
        state = str(self.state).encode()
        if mark is None:
            return Replica(state)
        part = ",".join(self.entries[mark.tracks :]).encode()
        return Replica(state, part, LogMark(True, len(self.entries), {}))


class Neighbours:
    """They keep what they are sent, unless they are away."""

    def __init__(self):
        self.kept = {"n2": Replicas(), "n3": Replicas()}
        self.away = self.forgets = False

    async def keep(self, node, owner, name, replica, after):
        if self.away:
            raise Unavailable("away")
        if self.forgets:
            self.kept[node.name].renew(owner, set())
            self.forgets = False
        return self.kept[node.name].keep(owner, name, replica.state, replica.log_part, after)

    async def present(self, node, owner, names):
        self.kept[node.name].renew(owner, set(names))

    async def forget_others(self, nodes):
        pass

    def log(self, name="n2"):
        """What the session's log is there."""
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


@pytest.mark.parametrize(("where", "limit"), [(peer, "LOG_BYTES"), (replication, "LOG_PART_BYTES")])
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
