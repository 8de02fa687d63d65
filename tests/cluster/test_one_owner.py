"""Nodes that stop, die, lose messages and drain, and directories that start again: at every instant
at most one node steps what lives in a group, and nothing is lost while no node dies, or if one dies
with the directory. Deleted sessions do not come back then.

Nodes are the real `NodeAgent`, `NodeLease` and `Replication`; time, network, sessions and their
death are made here.
"""

import asyncio
import contextlib
import random
from types import SimpleNamespace

import pytest

from tests.cluster import virtual_time
from tests.cluster.nodes import info
from wayfarer.cluster import node_agent, replication
from wayfarer.cluster.directory import Directory, LeaseRules
from wayfarer.cluster.messages import CALL_S
from wayfarer.cluster.node_agent import NodeAgent
from wayfarer.cluster.node_lease import NodeLease
from wayfarer.cluster.replicas import Replicas
from wayfarer.cluster.replication import COPY_S, Replication
from wayfarer.errors import AlreadyExists, NotFound, Unavailable, WayfarerError
from wayfarer.ids import group_of

TICK = 0.05
ANSWER_S = 2.0  # at least CALL_S of actors.py
LEASE = 5.0  # a lost answer costs ANSWER_S of it
NODES = 4
SECONDS = 150


class Moves:
    """Sessions of a node: none has a scene. Called like `SessionMoves`."""

    scenes = ()

    def __init__(self, node):
        self.node = node
        self.frozen = {}  # every session in the world of this node, and whether it is frozen
        self.open = {}  # those that callers find
        self.full_until = 0.0  # for those that are adopted

    @property
    def sessions(self):
        return list(self.open)

    @property
    def groups(self):
        return {group_of(name) for name in self.open}

    @property
    def live(self):
        return len(self.open)

    def of(self, group):
        return [name for name in self.open if group_of(name) == group]

    def is_movable(self, name):
        return True

    async def replica(self, name):
        await self.node.work()
        if name not in self.frozen:
            raise NotFound(name)
        return b"state"

    async def freeze(self, name):
        await self.node.work()
        if name not in self.open:
            raise NotFound(name)
        if self.node.sim.chance(0.05):
            raise Unavailable("calls on it do not end")
        self.frozen[name] = True
        return b"live"

    async def thaw(self, name):
        await self.node.work()
        if name not in self.frozen:
            raise NotFound(name)
        self.frozen[name] = False
        self.node.sim.check()

    async def take(self, name, live, content, orphan=False):
        await self.node.work()
        if name in self.frozen:
            raise AlreadyExists(name)
        if self.node.sim.chance(0.05) or (orphan and self.node.sim.now < self.full_until):
            raise Unavailable("no room")
        if orphan and self.node.sim.chance(0.1):
            self.full_until = self.node.sim.now + 4 * LEASE
        self.frozen[name] = True
        return SimpleNamespace(name=name, way="adopted" if orphan else "moved")

    async def enter(self, arrival):
        await self.node.work()
        if arrival.name not in self.frozen:
            raise NotFound(arrival.name)
        self.frozen[arrival.name] = False
        self.open[arrival.name] = True
        self.node.sim.seen[arrival.way] += 1
        self.node.sim.check()

    async def release(self, name, to):
        self.open.pop(name, None)
        await self.node.work()
        self.frozen.pop(name, None)

    def end(self, name):
        self.open.pop(name, None)
        self.frozen.pop(name, None)


class Node:
    """One process: its calls arrive late, or not, or their answers do not."""

    def __init__(self, sim, name):
        self.sim, self.name = sim, name
        self.stopped_until = 0.0
        self.lost = ()  # groups, by the latest answer of the directory, which may be on its way
        self.moves, self.replicas = Moves(self), Replicas(lambda: sim.now)
        self.lease = NodeLease(info(name), lambda: sim.now)
        peers = Peers(self)
        self.replication = Replication(self.lease, self.moves, peers)
        gateway = SimpleNamespace(
            moves=self.moves, started=True, alive=True, streams=0, loop_stats=self._stats
        )
        self.agent = NodeAgent(
            self.lease, gateway, self, peers, self.replicas, self.replication, self._end
        )
        self.tasks = [
            asyncio.create_task(self.agent.renewing()),
            asyncio.create_task(self.replication.running()),
        ]

    @property
    def stopped(self):
        return self.stopped_until > self.sim.now

    async def awake(self):
        while self.stopped:
            await asyncio.sleep(self.stopped_until - self.sim.now)

    async def work(self):
        """Runs on the motion thread."""
        await asyncio.sleep(self.sim.random.choice((0.0, 0.0, TICK, 0.2)))
        await self.awake()

    async def _stats(self):
        return SimpleNamespace(agents=0, sessions=len(self.moves.open), capacity=0)

    def _end(self):
        assert not self.moves.frozen, "a node ends that has sessions"
        self.sim.seen["drained"] += 1
        self.sim.kill(self.name)

    async def delete(self, name):
        """A call; it counts as answered once a neighbour has heard of it, and if no node still has
        the session frozen that gave it away and has not heard that it was taken.
        """
        self.moves.end(name)
        self.sim.living.discard(name)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(COPY_S - TICK):
                await self.replication.copied(name)
                told = self.replication.neighbour in self.lease.view.nodes and self.lease.leased
                if told and not any(name in one.moves.frozen for one in self.sim.nodes.values()):
                    self.sim.deleted.add(name)

    # The directory, as RayLink

    async def call(self, verb, *told):
        def ask():
            found = getattr(self.sim.directory, verb)(*told)
            if verb == "renew":
                self.lost = found.lost
            return found

        await self.awake()
        answer = self.sim.sent(ask)
        try:
            async with asyncio.timeout(ANSWER_S):
                result, error = await answer
        except TimeoutError:
            raise Unavailable("the directory does not answer") from None
        finally:
            await self.awake()
        if error is not None:
            raise error
        if verb == "renew":
            self.sim.seen["fenced"] += result.fenced
        return result


class Peers:
    """Other nodes, as RayNodes."""

    def __init__(self, caller):
        self.sim, self.caller = caller.sim, caller

    async def call(self, node, verb, *told, seconds=CALL_S):
        to, sim = self.sim.nodes.get(node.name), self.sim
        if to is None:
            raise Unavailable("it has ended")
        if sim.loses():
            await asyncio.sleep(seconds)
            raise Unavailable("deadline")
        await to.awake()
        sim.seen["handed on"] += verb == "keep" and told[0] != self.caller.name
        handling = asyncio.create_task(getattr(to.agent, verb)(*told))
        try:
            async with asyncio.timeout(0.2 if sim.chance(0.2) else seconds):  # or it is reset
                await asyncio.wait({handling})
            if handling.cancelled():
                raise Unavailable("it has ended")
            found = handling.result()
        except TimeoutError:
            handling.cancel()
            raise Unavailable("deadline") from None
        finally:
            await self.caller.awake()
        if sim.loses():
            await asyncio.sleep(seconds)
            raise Unavailable("deadline")
        return found


class Sim:
    def __init__(self, seed, rules, faults=True):
        """`faults`: nodes are stopped and killed, and the directory is started again."""
        self.random = random.Random(seed)
        self.rules, self.faults = rules, faults
        self.loop = asyncio.get_running_loop()
        self.nodes = {}
        self.started = self.made = 0
        self.living = set()  # sessions that were made and that nobody has ended
        self.deleted = set()  # by calls that were answered
        self.greatest = {}
        self.calls = set()
        self.seen = dict.fromkeys(
            (
                "adopted",
                "moved",
                "fenced",
                "stepped",
                "drained",
                "lost answers",
                "handed on",
                "found",
            ),
            0,
        )
        self.restart()
        self.directory._settled_at = 0.0

    @property
    def now(self):
        return self.loop.time()

    def chance(self, share):
        return self.random.random() < share

    def loses(self):
        lost = self.chance(0.06)
        self.seen["lost answers"] += lost
        return lost

    def restart(self):
        self.directory = Directory(
            self.rules, int(self.now * 1e6), lambda: self.now, self.random.random()
        )

    def start(self):
        name = f"n{self.started}"
        self.started += 1
        self.nodes[name] = Node(self, name)

    def kill(self, name, told=True):
        """`told`: its next life tells at once."""
        node = self.nodes.pop(name)
        for task in (*node.tasks, *node.agent._busy.values()):
            task.cancel()
        if told:
            self.directory.ended(name)

    def machine_ends(self):
        """A node and the directory end together. Returns the sessions without a copy."""
        self.restart()
        had = self.nodes[name := self.random.choice(sorted(self.nodes))].moves.open
        self.kill(name, told=False)
        kept = set().union(*(node.replicas._kept for node in self.nodes.values()))
        return set(had) - kept

    def sent(self, call):
        """A future of (answer, error); a call may arrive long after its caller has given up."""
        answer = self.loop.create_future()
        if self.loses():
            return answer

        async def arrive():
            await asyncio.sleep(self.random.choice((0.0, 0.0, TICK, 0.5)))
            if self.chance(0.02):
                await asyncio.sleep(5.0)
            try:
                found = call(), None
            except WayfarerError as error:
                found = None, error
            await asyncio.sleep(self.random.choice((0.0, TICK, 0.5)))
            if not (answer.done() or self.loses()):
                answer.set_result(found)

        task = asyncio.create_task(arrive())
        self.calls.add(task)
        task.add_done_callback(self.calls.discard)
        return answer

    async def run(self, seconds):
        ends = self.now + seconds
        while self.now < ends:
            self.tick()
            await asyncio.sleep(TICK)

    def tick(self):
        while len(self.nodes) < NODES:
            self.start()
        for name, node in list(self.nodes.items()):
            if node.stopped:
                continue
            if self.chance(0.05):
                self.create(node)
            alive = [one for one, frozen in node.moves.frozen.items() if not frozen]
            if self.chance(0.01) and alive and node.lease.may_step():
                deleting = node.delete(self.random.choice(sorted(alive)))
                node.tasks.append(asyncio.create_task(deleting))
            if self.chance(0.01) and node.lease.registered:
                with contextlib.suppress(WayfarerError):
                    self.directory.drain(name)
            if self.faults and self.chance(0.004):
                node.stopped_until = self.now + self.random.expovariate(1 / LEASE)
            if self.faults and self.chance(0.001):
                self.kill(name)
        if self.faults and self.chance(0.001):
            self.restart()
        if self.faults and self.chance(0.0005):
            self.machine_ends()
        self.check()

    def create(self, node):
        with contextlib.suppress(Unavailable):
            node.lease.new_group()  # which raises; its own would not be the same in each run
            name = f"session-{self.made:012x}{self.made:012x}"
            self.made += 1
            node.moves.frozen[name] = False
            node.moves.open[name] = True
            self.living.add(name)

    def check(self):
        owners = {}
        for node in self.nodes.values():
            if node.stopped or not node.lease.may_step():
                continue
            for name, frozen in node.moves.frozen.items():
                if frozen:
                    continue
                other = owners.setdefault(name, node.name)
                assert other == node.name, f"{name} is {other}'s and {node.name}'s"
                epoch = node.lease.epoch(name)
                assert epoch == 0 or epoch >= self.greatest.get(name, 0)
                self.greatest[name] = max(self.greatest.get(name, 0), epoch)
                self.seen["stepped"] += 1
        self.check_found()

    def check_found(self):
        """What this directory has known, and some node still has, is nowhere said not to exist."""
        for node in self.nodes.values():
            lost = {*node.lease.lost, *node.lost}
            for name in self.living.intersection(node.moves.open):
                known = node.lease.epoch(name) > self.directory._generation
                if not known or node.moves.frozen.get(name):
                    continue
                group = group_of(name)
                if group not in lost:
                    assert self.directory._told_owner(group), f"{name} is {node.name}'s"
                    self.seen["found"] += 1

    def stepped(self):
        """Sessions that somebody steps."""
        return {
            name
            for node in self.nodes.values()
            for name, frozen in node.moves.frozen.items()
            if not frozen
        }


@pytest.fixture(autouse=True)
def one_clock(monkeypatch):
    monkeypatch.setattr(node_agent, "boot_clock", lambda: asyncio.get_running_loop().time())
    quiet = SimpleNamespace(
        info=lambda *_, **__: None, warning=lambda *_, **__: None, error=lambda *_, **__: None,
        exception=lambda *_, **__: None)  # fmt: skip
    for module in (node_agent, replication):
        monkeypatch.setattr(module, "log", quiet)


@pytest.mark.parametrize("seed", range(8))
def test_never_two_owners(seed):
    async def main():
        sim = Sim(seed, LeaseRules(LEASE))
        await sim.run(SECONDS)
        return sim

    seen = virtual_time.run(main()).seen
    assert seen["stepped"] > 10_000 and all(seen.values()), seen


@pytest.mark.parametrize("seed", range(4))
def test_no_session_is_lost_while_messages_are(seed):
    async def main():
        sim = Sim(seed, LeaseRules(20 * LEASE), faults=False)
        await sim.run(SECONDS / 2)
        sim.chance = lambda share: False  # all goes well from now on
        await asyncio.sleep(60)
        assert sim.seen["drained"] > 3 and sim.seen["moved"] > 20, sim.seen
        assert sim.stepped() == sim.living
        assert not sim.directory.counters["expired"]

    virtual_time.run(main())


@pytest.mark.parametrize("seed", range(4))
def test_what_was_copied_outlives_a_machine_that_has_the_directory(seed):
    async def main():
        sim = Sim(seed, LeaseRules(4 * LEASE), faults=False)
        await sim.run(SECONDS / 2)
        lost = sim.machine_ends()
        await sim.run(SECONDS / 2)
        sim.chance = lambda share: False
        await asyncio.sleep(200)
        assert sim.living - lost <= sim.stepped()
        assert sim.deleted and not sim.deleted & sim.stepped(), "it has come back"
        assert sim.seen["adopted"] and not sim.directory.counters["expired"]

    virtual_time.run(main())
