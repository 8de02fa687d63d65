"""Copies at the neighbour: each second, and of what calls change."""

import asyncio
from types import SimpleNamespace

import pytest

from tests.cluster.nodes import info
from tests.runtime.running import until
from wayfarer.cluster import replication
from wayfarer.cluster.replicas import CONTENT, Replicas
from wayfarer.cluster.replication import Replication
from wayfarer.errors import Unavailable

SESSION = "session-00ff34"


SCENES = ("scene-00dd11",)
OTHERS = tuple(f"session-00ee{number}" for number in range(10, 14))


class Sessions:
    """Sessions of one node; each state has another number."""

    def __init__(self):
        self.sessions, self.scenes = [SESSION], []
        self.state, self.broken = 0, None
        self.going_on = asyncio.Event()
        self.going_on.set()

    def is_movable(self, name):
        return True

    async def replica(self, name):
        self.state += 1
        if name == self.broken:
            raise KeyError(name)
        state = str(self.state).encode()
        await self.going_on.wait()
        return state

    async def content(self, scene_id):
        return b"content"


class Neighbours:
    """They keep what they are sent, unless they are away."""

    def __init__(self):
        self.kept = {"n2": Replicas(), "n3": Replicas()}
        self.away = self.broken = False
        self.refuses, self.contents, self.messages = None, [], []

    async def call(self, node, verb, *told, seconds=0):
        if self.away:
            raise Unavailable("away")
        self.messages.append(verb)
        return getattr(self, verb)(self.kept[node.name], *told)

    def keep(self, kept, owner, copies):
        self.contents += [name for name in copies if name.endswith(CONTENT)]
        for name, state in copies.items():
            if name != self.refuses:
                kept.keep(owner, name, state)
        return {name: "too large" for name in copies if name == self.refuses}

    def present(self, kept, owner, names):
        if self.broken:
            raise KeyError("a bug")
        return {name for name in kept.renew(owner, set(names)) if name in SCENES}

    def state(self, name="n2"):
        """The record of the one session at the neighbour."""
        [kept] = self.kept[name]._kept.values()
        return int(kept.state)


@pytest.fixture
async def copies(monkeypatch):
    monkeypatch.setattr(replication, "REPLICATE_S", 0.01)
    nodes = {name: info(name) for name in ("n1", "n2", "n3")}
    view = SimpleNamespace(nodes=nodes)
    lease = SimpleNamespace(node=nodes["n1"], view=view, may_step=lambda: True, names_coming=[])
    made = SimpleNamespace(moves=Sessions(), peers=Neighbours())
    made.work = Replication(lease, made.moves, made.peers)
    made.work.neighbour = "n2"

    async def rounds(count=3):
        wanted = made.moves.state + count
        await until(lambda: made.moves.state >= wanted)

    made.rounds = rounds
    running = asyncio.create_task(made.work.running())
    yield made
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)


async def test_each_round_replaces_the_copy_also_after_a_failure(copies):
    await copies.rounds()
    before = copies.peers.state()
    await copies.rounds()
    assert copies.peers.state() > before
    copies.peers.away = True
    await asyncio.sleep(0.05)
    before, copies.peers.away = copies.peers.state(), False
    await copies.rounds()
    assert copies.peers.state() > before


async def test_a_new_neighbour_gets_a_copy(copies):
    await copies.rounds()
    copies.work.neighbour = "n3"
    await copies.rounds()
    assert copies.peers.state("n3") > copies.peers.state("n2")


async def test_the_content_of_a_scene_is_sent_once_to_each_neighbour_and_until_it_is_kept(copies):
    content = SCENES[0] + CONTENT
    copies.peers.refuses, copies.moves.scenes = content, list(SCENES)
    await copies.rounds(6)
    tried = len(copies.peers.contents)
    assert tried > 1
    copies.peers.refuses = None
    await copies.rounds(6)
    assert copies.peers.kept["n2"]._kept[content].state == b"content"
    sent = len(copies.peers.contents)
    await copies.rounds(6)
    assert len(copies.peers.contents) == sent
    copies.work.neighbour = "n3"
    await copies.rounds(6)
    assert content in copies.peers.kept["n3"]._kept and len(copies.peers.contents) == sent + 1


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
    assert kept.keys() == {*OTHERS[1:], SESSION}, "a node that has ended is known, too"
    assert all(int(kept[name].state) > before for name in (*OTHERS[2:], SESSION))
    assert OTHERS[1] in caplog.text


async def test_a_round_that_fails_is_not_the_last_one(copies, caplog):
    await copies.rounds()
    copies.peers.broken = True
    await until(lambda: "a round of copies failed" in caplog.text)
    copies.peers.broken = False
    before = copies.peers.state()
    await copies.rounds()
    assert copies.peers.state() > before


@pytest.fixture
def seldom(monkeypatch, copies):
    monkeypatch.setattr(replication, "REPLICATE_S", 1000.0)
    monkeypatch.setattr(replication, "AGAIN_S", 0.01)
    return copies


async def test_a_change_is_copied_at_once_and_calls_share_a_message(seldom):
    await asyncio.sleep(0.05)  # the first round
    before, seldom.peers.messages[:] = seldom.moves.state, []
    await asyncio.gather(*(seldom.work.copied(SESSION) for _ in range(20)))
    assert seldom.peers.state() == seldom.moves.state == before + 2
    assert seldom.peers.messages == ["present", "keep"] * 2  # of the first call, and of all others
    seldom.moves.sessions.clear()
    await seldom.work.copied(SESSION)
    assert not len(seldom.peers.kept["n2"]), "an ended session does not come back"


async def test_a_call_waits_for_a_state_that_is_newer_than_its_change(seldom):
    """One that is on its way when the call comes is not enough, and does not replace the newer."""
    await asyncio.sleep(0.05)
    seldom.moves.going_on.clear()
    first = asyncio.create_task(seldom.work.copied(SESSION))
    await asyncio.sleep(0.01)
    on_its_way = seldom.moves.state
    second = asyncio.create_task(seldom.work.copied(SESSION))
    await asyncio.sleep(0.01)
    seldom.moves.going_on.set()
    await asyncio.gather(first, second)
    assert seldom.peers.state() == seldom.moves.state == on_its_way + 1


async def test_a_call_that_is_given_up_takes_no_copy_from_others(seldom):
    await asyncio.sleep(0.05)
    seldom.moves.going_on.clear()
    calls = [asyncio.create_task(seldom.work.copied(SESSION)) for _ in range(3)]
    await asyncio.sleep(0.01)
    before = seldom.peers.state()
    calls[0].cancel()  # whose message was for all of them
    seldom.moves.going_on.set()
    await asyncio.gather(*calls[1:])
    assert seldom.peers.state() == seldom.moves.state > before


async def test_a_call_waits_for_the_next_neighbour_and_for_nobody_without_one(seldom):
    await asyncio.sleep(0.05)
    seldom.peers.away = True
    copying = asyncio.create_task(seldom.work.copied(SESSION))
    await asyncio.sleep(0.05)
    assert not copying.done()
    seldom.work.neighbour, seldom.peers.away = "n3", False
    await copying
    assert seldom.peers.state("n3") == seldom.moves.state
    seldom.work.neighbour, seldom.peers.away = "", True
    await seldom.work.copied(SESSION)


async def test_a_session_that_has_no_time_delays_no_call_on_another(seldom, monkeypatch):
    monkeypatch.setattr(replication, "STATE_S", 0.05)
    await asyncio.sleep(0.05)
    replica = seldom.moves.replica

    async def busy(name):
        return await (asyncio.Event().wait() if name == OTHERS[0] else replica(name))

    seldom.moves.replica = busy
    seldom.moves.sessions = [OTHERS[0], SESSION]
    async with asyncio.timeout(1):
        await asyncio.gather(seldom.work.copied(OTHERS[0]), seldom.work.copied(SESSION))
    assert seldom.peers.kept["n2"]._kept.keys() == {SESSION}


async def test_a_change_in_a_scene_is_copied_with_its_content(seldom):
    seldom.moves.scenes.extend(SCENES)
    await seldom.work.copied(SCENES[0])
    kept = seldom.peers.kept["n2"]._kept
    assert {SCENES[0], SCENES[0] + CONTENT} <= kept.keys()
