"""A node gives groups away, takes and adopts them, while answers are lost and room is scarce."""

import asyncio
from types import SimpleNamespace

import pytest

from tests.cluster import virtual_time
from tests.cluster.nodes import LEASE, Bench, info
from wayfarer.cluster.directory import Directory, LeaseRules
from wayfarer.cluster.messages import NodeOrder
from wayfarer.cluster.node_agent import NodeAgent
from wayfarer.cluster.node_lease import NodeLease
from wayfarer.cluster.replicas import Replicas
from wayfarer.errors import Aborted, InvalidArgument, NotFound, ResourceExhausted, Unavailable
from wayfarer.ids import group_of

ANSWER_S = 1.5  # as in actors.py, which needs Ray


class Moves:
    """Sessions, and whether they are frozen."""

    scenes = ()

    def __init__(self):
        self.frozen, self.taken, self.refusals = {}, [], {}

    @property
    def groups(self):
        return {group_of(name) for name in self.frozen}

    @property
    def live(self):
        return len(self.frozen)

    def of(self, group):
        return [name for name in self.frozen if group_of(name) == group]

    def is_movable(self, name):
        return True

    async def freeze(self, name):
        self.frozen[name] = True
        return b"live"

    async def thaw(self, name):
        self.frozen[name] = False

    async def take(self, name, live, content, orphan=False):
        if refusals := self.refusals.get(name):
            raise refusals.pop(0)
        self.taken.append(name)
        self.frozen[name] = True
        return name

    async def enter(self, name):
        if name not in self.taken:
            raise NotFound(name)
        self.frozen[name] = False

    async def release(self, name, to):
        self.frozen.pop(name, None)


class Pair:
    """n1 has a session and gives it to n2. `losses`: of what is lost, in the order of the calls."""

    def __init__(self, losses=()):
        self.bench, self.losses = Bench(["n1", "n2"]), list(losses)
        self.group = self.bench.new_session("n1")
        self.bench.beat()
        self.bench.beat()
        self.name = f"session-{self.group}{0:012x}"
        self.asked = []
        self.stopped = []
        self.moves, self.agents, self.replicas = {}, {}, {}
        for name in ("n1", "n2"):
            self.moves[name], self.replicas[name] = Moves(), Replicas()
            gateway = SimpleNamespace(moves=self.moves[name], streams=0)
            self.agents[name] = NodeAgent(
                self.bench.nodes[name], gateway, self, SimpleNamespace(call=self.peer),
                self.replicas[name],
                SimpleNamespace(copied=self.copied), lambda: self.stopped.append(1),
            )  # fmt: skip
        self.moves["n1"].frozen[self.name] = False

    def loses(self, what):
        if self.losses[:1] == [what]:
            return self.losses.pop(0)
        return None

    async def call(self, verb, *told):
        if verb != "claim":
            return getattr(self.bench.directory, verb)(*told)
        self.asked.append(told[-1])
        if self.loses("question"):
            raise Unavailable("the directory does not answer")
        epoch = self.bench.directory.claim(*told)
        if self.loses("answer"):
            raise Unavailable("the directory does not answer")
        return epoch

    async def copied(self, name):
        """There is no neighbour."""

    async def peer(self, node, verb, *told, seconds=0):
        if self.loses("take"):
            raise Unavailable("deadline")
        await getattr(self.agents[node.name], verb)(*told)
        if self.loses("taken"):
            raise Unavailable("deadline")

    def move(self):
        epoch = self.bench.nodes["n1"].epoch(self.name)
        order = NodeOrder(kind="move", group=self.group, epoch=epoch, to="n2")

        async def moving():
            beating = asyncio.create_task(self.beating())
            await self.agents["n1"]._move(order)
            await asyncio.sleep(5)
            beating.cancel()

        virtual_time.run(moving())

    async def beating(self):
        while True:
            await asyncio.sleep(0.25)
            for name in ("n1", "n2"):
                self.bench.present[name] = self.moves[name].groups
            self.bench.later(0.25, "n1", "n2")

    @property
    def owner(self):
        """The only node that steps it, which must be the directory's choice, too."""
        [found] = [name for name in self.moves if self.moves[name].frozen == {self.name: False}]
        assert self.bench.owner(self.group) == found
        epoch = self.bench.directory._groups[self.group].epoch
        assert {n: node.epoch(self.name) for n, node in self.bench.nodes.items() if node.epoch(
            self.name)} == {found: epoch}  # fmt: skip
        return found


@pytest.mark.parametrize(
    ("losses", "owner", "asked"),
    [
        ([], "n2", ["n2"]),
        (["question", "answer", "answer"], "n2", ["n2"] * 4),
        (["answer", "taken"], "n2", ["n2", "n2", "n1", "n1"]),
        (["taken", "question"], "n2", ["n2", "n1", "n1"]),
        (["take"], "n1", ["n1"]),
        (["take", "question", "answer"], "n1", ["n1"] * 3),
    ],
)
def test_whatever_is_lost_during_a_move_one_node_has_the_session(losses, owner, asked):
    pair = Pair(losses)
    pair.move()
    assert (pair.owner, pair.asked, pair.losses) == (owner, asked, [])


def test_who_has_given_a_group_away_keeps_it_until_its_new_node_has_heard_so():
    """The directory ends before its answer has come there; the next one knows of no gift."""
    pair, taking, seen = Pair(["answer"] * 4), [], []
    bench = pair.bench

    async def peer(node, verb, *told, seconds=0):
        taking.append(asyncio.create_task(getattr(pair.agents[node.name], verb)(*told)))
        asyncio.get_running_loop().call_later(0.6, restart)
        await asyncio.sleep(0.2)
        raise Unavailable("deadline")

    def restart():
        seen.append(bench.owner(pair.group))
        seen.extend(dict(moves.frozen) for moves in pair.moves.values())
        generation = bench.directory._epoch + 1000
        bench.directory = Directory(LeaseRules(LEASE), generation, lambda: bench.now)

    pair.agents["n1"]._nodes.call = peer
    pair.move()
    assert seen == ["n2", {pair.name: True}, {pair.name: True}]
    assert pair.owner == "n1" and isinstance(taking[0].exception(), Aborted)


def test_what_cannot_be_known_stays_frozen_and_the_owner_may_move_it_again():
    pair = Pair(["take"] + ["question"] * 20)
    seen = []
    question = pair.call

    async def call(*told):
        seen.append(pair.moves["n1"].frozen[pair.name])
        return await question(*told)

    pair.call = call
    pair.move()
    assert seen == [True] * 21 and pair.owner == "n1"
    pair.move()
    assert pair.owner == "n2"


def test_who_has_withdrawn_an_offer_keeps_the_session_though_all_of_it_has_come():
    pair = Pair()
    n1, n2 = pair.bench.nodes.values()
    epoch = n1.epoch(pair.name)
    pair.bench.directory.claim(pair.group, "n1", epoch, "n1")
    with pytest.raises(Aborted, match="does not give"):
        virtual_time.run(pair.agents["n2"].take("n1", pair.group, epoch, {pair.name: b"live"}))
    assert pair.moves["n2"].taken and not pair.moves["n2"].frozen and not n2.epoch(pair.name)


def test_a_node_does_not_end_while_something_lives_on_it():
    pair = Pair()
    done = pair.bench.beat("n1")["n1"].model_copy(update={"done": True})
    virtual_time.run(pair.agents["n1"]._obey(done))
    assert not pair.stopped
    pair.moves["n1"].frozen.clear()
    virtual_time.run(pair.agents["n1"]._obey(done))
    assert pair.stopped


def adopt(refusals):
    """The sessions that n2 continues after the death of n1; each meets these errors first.

    `refusals`: by the last two digits of its id.
    """
    pair = Pair()
    for end, errors in refusals.items():
        name = f"{pair.name[:-2]}{end}"
        pair.replicas["n2"].keep("n1", name, b"state")
        pair.moves["n2"].refusals[name] = errors
    pair.bench.directory.ended("n1")
    del pair.bench.nodes["n1"]

    async def obey():
        for _ in range(3):
            await pair.agents["n2"]._obey(pair.bench.beat("n2")["n2"])
            await asyncio.gather(*pair.agents["n2"]._busy.values())
            pair.bench.present["n2"] = pair.moves["n2"].groups

    virtual_time.run(obey())
    counters = pair.bench.directory.counters
    found = [name[-2:] for name in pair.moves["n2"].frozen]
    return found, len(pair.replicas["n2"]), counters["adopted"], counters["lost"]


def test_an_adoption_waits_for_room():
    full = Unavailable("4096 commands are waiting already; try again")
    assert adopt({"00": [full, full]}) == (["00"], 0, 1, 0)
    assert adopt({"00": [], "01": [full]}) == (["00", "01"], 0, 1, 0)


def test_without_room_all_of_a_group_is_handed_on_to_a_node_that_has_some():
    """n2 has taken over one of two: that ends there, before n3 hears of it."""
    there = Bench(["n3"]).nodes["n3"].node
    left, orders = {}, []

    class Three(Pair):
        async def call(self, verb, *told):
            if verb != "place":
                return await super().call(verb, *told)
            self.bench.add("n3")
            return there

        async def peer(self, node, verb, owner, copies, seconds=0):
            assert verb == "keep"
            [(name, state)] = copies.items()
            left.setdefault(node.name, []).append((owner, name[-2:], state))
            return {}

    pair = Three()
    for end in ("00", "01"):
        name = f"{pair.name[:-2]}{end}"
        pair.replicas["n2"].keep("n1", name, end.encode())
    pair.moves["n2"].refusals[name] = [ResourceExhausted("full")] * 1000
    pair.bench.directory.ended("n1")
    del pair.bench.nodes["n1"]

    async def obey():
        await pair.agents["n2"]._obey(pair.bench.beat("n2")["n2"])
        await asyncio.gather(*pair.agents["n2"]._busy.values())
        pair.bench.present["n2"] = pair.moves["n2"].groups
        pair.bench.beat("n2")
        orders.extend(pair.bench.beat("n3")["n3"].orders)

    virtual_time.run(obey())
    assert left == {"n3": [("n1", "00", b"00"), ("n1", "01", b"01")]}
    assert not pair.moves["n2"].frozen and not len(pair.replicas["n2"])
    assert [(one.kind, one.group) for one in orders] == [("adopt", pair.group)]
    assert not pair.bench.directory.counters["lost"]


def test_what_is_refused_for_good_is_not_adopted_and_the_others_are():
    damaged = InvalidArgument("damaged")
    assert adopt({"00": [damaged], "01": []}) == (["01"], 0, 1, 0)
    assert adopt({"00": [damaged]}) == ([], 0, 0, 1)
    assert adopt({"00": [Unavailable("")] * 9000}) == ([], 0, 0, 1), "it gives up at last"


def test_who_has_given_a_group_away_adopts_it_if_its_new_node_ends_before_anybody_has_a_copy():
    pair = Pair()
    pair.move()
    assert pair.owner == "n2"
    pair.bench.directory.ended("n2")
    del pair.bench.nodes["n2"]
    pair.moves["n2"].frozen.clear()

    async def obey():
        for _ in range(3):
            await pair.agents["n1"]._obey(pair.bench.beat("n1")["n1"])
            await asyncio.gather(*pair.agents["n1"]._busy.values())
            pair.bench.present["n1"] = pair.moves["n1"].groups

    virtual_time.run(obey())
    assert pair.moves["n1"].frozen == {pair.name: False} and not len(pair.replicas["n1"])
    assert not pair.bench.directory.counters["lost"]


def test_all_sessions_of_a_scene_stand_still_together():
    """Each for as long as one takes, and after the scene."""
    pair, log = Pair(), []
    scene, other = f"scene-{pair.group}{0:012x}", f"session-{pair.group}{1:012x}"
    for name in (other, scene):
        pair.moves["n1"].frozen[name] = False

    def slow(node, verb):
        work = getattr(pair.moves[node], verb)

        async def later(name, *told):
            began = asyncio.get_running_loop().time()
            await asyncio.sleep(1.0)
            log.append((verb, name.partition("-")[0], began, asyncio.get_running_loop().time()))
            return await work(name, *told)

        setattr(pair.moves[node], verb, later)

    async def content(name):
        return b"content"

    pair.moves["n1"].content = content
    slow("n1", "freeze")
    slow("n2", "take")

    async def peer(node, verb, *told, seconds=0):
        return await getattr(pair.agents[node.name], verb)(*told)

    pair.agents["n1"]._nodes.call = peer
    pair.move()
    assert pair.moves["n2"].frozen == {pair.name: False, other: False, scene: False}
    for verb in ("freeze", "take"):
        (_, first, _, ended), *others = [one for one in log if one[0] == verb]
        assert first == "scene" and [one[1] for one in others] == ["session", "session"]
        assert all(one[2] == ended and one[3] == ended + 1.0 for one in others)


def test_a_busy_node_that_loses_an_answer_of_the_directory_keeps_its_lease():
    """As while it is drained: otherwise a neighbour would continue its sessions from copies."""

    async def renew():
        now = asyncio.get_running_loop().time
        directory, lease = Directory(LeaseRules(3.0, nodes=1), 1, now), NodeLease(info("n1"), now)
        lost = [4]  # renewals, counted from the first

        async def call(verb, told):
            if told.count in lost:
                await asyncio.sleep(ANSWER_S)
                raise Unavailable("the directory does not answer")
            return directory.renew(told)

        async def loop_stats():
            await asyncio.sleep(60)  # the motion thread takes in sessions

        moves = Moves()
        gateway = SimpleNamespace(
            moves=moves, started=True, alive=True, streams=0, loop_stats=loop_stats
        )
        link = SimpleNamespace(call=call)
        replication = SimpleNamespace(neighbour="")
        agent = NodeAgent(lease, gateway, link, link, Replicas(), replication, lambda: None)
        renewing = asyncio.create_task(agent.renewing())
        while lease._count < 2 or not lease.leased:
            await asyncio.sleep(0.01)
        moves.frozen[f"session-{lease.new_group()}{0:012x}"] = False
        ends_at = now() + 20
        while now() < ends_at:
            await asyncio.sleep(0.01)
            assert lease.leased
        assert directory.counters["expired"] == 0
        assert directory.look((0, 0))[0].nodes[0].load.sessions == 1, "placement knows of it"
        renewing.cancel()

    virtual_time.run(renew())
