"""Nodes and directories as the tests of this folder make them."""

import asyncio

from wayfarer.cluster.directory import Directory, LeaseRules
from wayfarer.cluster.messages import LeaseRenewal, NodeInfo, NodeLoad
from wayfarer.cluster.node_lease import NodeLease
from wayfarer.errors import Unavailable

LEASE = 2.0


def info(name, fingerprint="a", capacity=100, number=None):
    number = int(name[1:]) if number is None else number
    return NodeInfo(
        name=name,
        number=number,
        host="127.0.0.1",
        grpc_port=1000 + number,
        http_port=2000 + number,
        fingerprint=fingerprint,
        capacity=capacity,
    )


class Link:
    """A link to a directory in this process, which may be `away` for a while."""

    def __init__(self, rules):
        self.directory = Directory(rules, 1)
        self.away = False

    async def call(self, verb, *told):
        await asyncio.sleep(0)
        if self.away:
            raise Unavailable("the directory is away")
        return getattr(self.directory, verb)(*told)


class Bench:
    """A directory and nodes on one clock; every message arrives at once."""

    def __init__(self, names=(), generation=1000, settled=True, **rules):
        self.now = 100.0
        self.directory = Directory(LeaseRules(LEASE, **rules), generation, lambda: self.now, seed=1)
        self.nodes = {}
        self.present = {}
        self.loads = {}
        if settled:
            self.now += LEASE * 3
        for name in names:
            self.add(name)
        self.beat()

    def add(self, name, **fields):
        """`fields`: of its NodeInfo; `number` where the name does not say it."""
        node = NodeLease(info(name, **fields), lambda: self.now)
        self.nodes[name] = node
        self.present.setdefault(name, set())
        self.loads[name] = NodeLoad()
        self.beat(name)
        return node

    def new_session(self, name):
        group = self.nodes[name].new_group()
        self.present[name].add(group)
        return group

    def beat(self, *names):
        """Let these nodes, or all, renew; their last answers."""
        answers = {}
        for name in names or list(self.nodes):
            node = self.nodes[name]
            told = node.renewal(self.loads[name], self.present[name])
            answers[name] = self.directory.renew(told)
            node.take(answers[name], told, self.now)
        return answers

    def adopt(self, name, order):
        """This node has what lives in a group."""
        node, group = self.nodes[name], order.group
        node.coming(group, order.epoch)
        node.decided(group, self.directory.claim(group, name, order.epoch, name))
        node.came(group)
        self.present[name].add(group)

    @property
    def status(self):
        """The directory's view of the cluster."""
        return self.directory.look((0, 0))[0]

    def owner(self, group):
        """Name of the node that has a group."""
        return owner(self.directory, group)

    def later(self, seconds, *names):
        """Lets time pass; only these nodes renew meanwhile, four times a second."""
        for _ in range(round(seconds * 4)):
            self.now += 0.25
            if names:
                self.beat(*names)


def named(group):
    """A session in it."""
    return f"session-{group}0123456789ab"


def renewal(name, **fields):
    return LeaseRenewal(name=name, count=fields.pop("count", 1), **fields)


def coming(name, **fields):
    """The renewal with which it comes."""
    return renewal(name, node=info(name), **fields)


def owner(directory, group):
    """Name of the node that has a group; None: nobody."""
    entry = directory._groups.get(group)
    return entry and entry.owner
