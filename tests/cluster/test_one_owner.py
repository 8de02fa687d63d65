"""Nodes that stop, die, lose messages and drain, and directories that start again: at every instant
at most one node may step what lives in a slot, and it is the one whose epoch is the greatest.
"""

import contextlib
import random

import pytest

from tests.cluster.nodes import LEASE, info
from wayfarer.cluster.directory import Directory, LeaseRules
from wayfarer.cluster.messages import NodeLoad
from wayfarer.cluster.tenancy import Tenancy
from wayfarer.errors import WayfarerError
from wayfarer.ids import SLOTS

TICK = 0.05


class Sim:
    def __init__(self, seed, go_on):
        self.random = random.Random(seed)
        random.seed(seed)  # Tenancy draws from it
        self.now = 1000.0
        self.rules = LeaseRules(LEASE, go_on)
        self.started = 0
        self.nodes, self.present, self.stopped = {}, {}, {}
        self.greatest = dict.fromkeys(range(SLOTS), 0)
        self.restart()
        self.coming = []  # (when, what): answers on their way
        self.seen = dict.fromkeys(("adopted", "moved", "lost", "fenced", "stepped"), 0)

    def restart(self):
        self.directory = Directory(self.rules, self.now, int(self.now * 1e6), self.random.random())

    def start(self):
        name = f"n{self.started}"
        self.started += 1
        self.nodes[name] = Tenancy(info(name), self.rules.go_on, lambda: self.now)
        self.present[name], self.stopped[name] = set(), 0.0

    def live(self):
        return [name for name in self.nodes if self.stopped[name] <= self.now]

    def tick(self):
        self.now += TICK
        chance = self.random.random
        while len(self.nodes) < 4:
            self.start()
        for name in self.live():
            if chance() < 0.1:
                self.beat(name)
            if chance() < 0.05:
                self.create(name)
            if chance() < 0.01 and self.present[name]:
                self.present[name].pop()
            if chance() < 0.004:
                self.stopped[name] = self.now + self.random.expovariate(1 / LEASE)
            if chance() < 0.001:
                self.kill(name)
            if chance() < 0.002 and self.nodes[name].registered:
                with contextlib.suppress(WayfarerError):
                    self.directory.drain(name)
        if chance() < 0.001:
            self.restart()
        due = [what for when, what in self.coming if when <= self.now]
        self.coming = [(when, what) for when, what in self.coming if when > self.now]
        for what in due:
            what()
        self.check()

    def beat(self, name):
        node, sent_at = self.nodes[name], self.now
        coming = not node.registered
        told = (
            node.registration(NodeLoad(), self.present[name] - node.lost)
            if coming
            else node.renewal(NodeLoad(), self.present[name] - node.lost)
        )
        if self.random.random() < 0.1:
            return  # lost on its way there
        answer = (self.directory.register if coming else self.directory.renew)(told, self.now)

        def arrive():
            if name not in self.nodes or coming == node.registered:
                return
            if self.stopped[name] > self.now:
                return
            self.seen["fenced"] += answer.fenced
            take = node.take_registered if coming else node.take_renewed
            if take(answer, told, sent_at):
                self.obey(name, answer)

        if self.random.random() < 0.1:
            return  # lost on its way back
        self.coming.append((self.now + self.random.choice((0, TICK, 1.0)), arrive))

    def obey(self, name, answer):
        node = self.nodes[name]
        for slot in node.lost:
            self.present[name].discard(slot)
            node.released(slot)
        for order in answer.orders:
            if order.kind == "adopt":
                if node.epoch(f"session-{order.slot:04x}") >= order.epoch:
                    continue  # an order said twice
                if self.random.random() < 0.8:
                    self.present[name].add(order.slot)
                    node.adopted(order.slot, order.epoch)
                    self.seen["adopted"] += 1
                else:
                    node.failed(order.slot)
                    self.seen["lost"] += 1
            elif order.slot in self.present[name]:
                self.move(name, order)
        if answer.done:
            self.kill(name)

    def move(self, name, order):
        node = self.nodes[name]
        node.moving(order.slot)
        try:
            epoch = self.directory.transfer(order.slot, name, order.epoch, order.to, self.now)
        except WayfarerError:
            node.stays(order.slot, node.epoch(f"session-{order.slot:04x}"))
            return
        if order.to in self.live() and self.random.random() < 0.8:
            self.present[name].discard(order.slot)
            node.moved(order.slot)
            self.present[order.to].add(order.slot)
            self.nodes[order.to].came(order.slot, epoch)
            self.seen["moved"] += 1
            return
        try:
            back = self.directory.transfer(order.slot, order.to, epoch, name, self.now)
        except WayfarerError:
            self.present[name].discard(order.slot)
            node.moved(order.slot)
        else:
            node.stays(order.slot, back)

    def create(self, name):
        with contextlib.suppress(WayfarerError):
            self.present[name].add(self.nodes[name].new_key())

    def kill(self, name):
        """The keeper sees the end of its process at once."""
        del self.nodes[name], self.present[name], self.stopped[name]
        self.directory.ended(name)

    def check(self):
        owners = {}
        for name in self.live():
            node = self.nodes[name]
            if not node.may_step():
                continue
            for slot in self.present[name] & set(node._held):
                assert slot not in owners, f"{slot} is {owners[slot]}'s and {name}'s"
                owners[slot] = name
                epoch = node.epoch(f"session-{slot:04x}")
                assert epoch == 0 or epoch >= self.greatest[slot]
                self.greatest[slot] = max(self.greatest[slot], epoch)
                self.seen["stepped"] += 1


@pytest.mark.parametrize("go_on", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_never_two_owners(seed, go_on):
    sim = Sim(seed, go_on)
    for _ in range(3000):
        sim.tick()
    assert sim.seen["stepped"] > 10_000
    assert sim.seen["adopted"] and sim.seen["moved"]
    assert sim.seen["fenced"]
