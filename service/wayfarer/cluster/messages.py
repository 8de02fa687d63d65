"""What nodes, entries and the directory tell each other, and how they call each other.

A *node* is a server process with its own ports, under a name that no other process ever gets again.
A *group* is a scene with its sessions, or a session alone: the first digits of their ids (ids.py).
"""

from typing import Any, Final, Literal, Protocol

from pydantic import BaseModel, ConfigDict

from wayfarer.config.settings import Settings

ADOPTED: Final = "?"
"""Stands for an owner while a group is being adopted, or may be a silent node's. No node has this
name."""

SILENT_S: Final = 1.5
"""Seconds without a renewal after which no client is sent to a node. Its process may be stopped;
clients would wait there, or come back, until its lease ends."""

CALL_S: Final = 10.0
"""Seconds to wait for a node's answer."""


class DirectoryLink(Protocol):
    """A way to the directory."""

    async def call(self, verb: str, *told: Any) -> Any:
        """`Directory`'s method of this name. Raises what it raises, and Unavailable when the
        directory is away.
        """
        ...


class NodeLink(Protocol):
    """A way to the nodes."""

    async def call(self, node: "NodeInfo", verb: str, *told: Any, seconds: float = CALL_S) -> Any:
        """`NodeAgent`'s method of this name. Raises what it raises; Unavailable when there is no
        answer: it may be done all the same.
        """
        ...


class ClusterMessage(BaseModel):
    """Base of all messages; unknown fields are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class NodePlan(ClusterMessage):
    """The name, place and options of a node."""

    name: str
    number: int
    host: str  # at which clients reach it; empty: that at which they called the entry
    cores: tuple[int, ...] = ()  # those it may run on; none: all
    settings: Settings


class NodeInfo(ClusterMessage):
    """The fields that do not change while a node lives."""

    name: str
    number: int  # of its plan, from 0
    host: str  # empty: clients call it at the host at which they called the entry
    grpc_port: int
    http_port: int
    fingerprint: str  # hash over model, bodies, format: sessions move only between equals
    capacity: int  # agents at most, by its limits
    machine: str = ""  # see `node_lease.machine`; with `pid` it names the process
    pid: int = 0


class NodeLoad(ClusterMessage):
    """The load of a node."""

    agents: int = 0
    sessions: int = 0
    ready: bool = True  # it takes new sessions
    fits: int = 0  # agents that it can move in time, as measured; 0: not known yet


class LeaseRenewal(ClusterMessage):
    """Renews the lease, several times in its length. Everything in it may be said twice."""

    name: str
    count: int  # grows with each renewal: one that arrives after its successor is ignored
    load: NodeLoad = NodeLoad()
    node: NodeInfo | None = None  # it comes, or comes again: `held` is all that it has
    leased: bool = False  # a lease of an earlier directory still holds
    held: dict[str, int] = {}  # groups and their epochs: new ones, and a share of the others
    freed: tuple[str, ...] = ()  # groups that hold none any more
    kept: dict[str, tuple[str, float]] = {}  # it comes: groups of its replicas, owners, ages
    seen: tuple[int, int] = (0, 0)  # generation and version of the node's view


class NodeOrder(ClusterMessage):
    """A node's task with a group; repeated until it is done."""

    kind: Literal["adopt", "move"]
    group: str
    epoch: int  # adopt: the new epoch; move: the present one
    to: str = ""  # move: the node


class Changes(ClusterMessage):
    """Changes of the view since a version, or the whole of it."""

    generation: int  # of the directory: another one knows nothing of the versions before
    version: int
    whole: bool = False
    settled: bool = True  # else nodes have still to name their groups
    groups: dict[str, str] = {}  # owners; empty: nobody any more; `ADOPTED`: nobody yet
    nodes: tuple[NodeInfo, ...] | None = None  # all live ones, when they have changed


class Answer(ClusterMessage):
    """The directory's answer to a renewal."""

    fenced: bool = False  # the node is not known, or its lease has ended: it tells all that it has
    lease_s: float = 0.0  # from when the request was sent; 0: none yet, ask again
    epochs: dict[str, int] = {}  # of owned groups: all that it named, and the same share
    lost: tuple[str, ...] = ()  # groups that have another owner: release them before stepping
    neighbour: str = ""  # the node that keeps this one's replicas; empty: there is none
    draining: bool = False
    done: bool = False  # drained: end
    orders: tuple[NodeOrder, ...] = ()
    changes: Changes | None = None


class NodeState(ClusterMessage):
    """A node as the directory sees it."""

    node: NodeInfo
    load: NodeLoad
    groups: int  # in use
    lease_left_s: float
    silent_s: float  # since its last renewal
    draining: bool
    neighbour: str


class Status(ClusterMessage):
    """The directory at a glance: for commands, health and metrics."""

    generation: int
    settled: bool  # an older directory's leases have ended
    nodes: tuple[NodeState, ...]
    counters: dict[str, int]

    @property
    def capacity(self) -> int:
        """Agents that the nodes that take sessions can move in time, as far as that is known."""
        return sum(
            min(one.node.capacity, one.load.fits or one.node.capacity)
            for one in self.nodes
            if _takes(one)
        )

    @property
    def agents(self) -> int:
        """Agents on these nodes."""
        return sum(one.load.agents for one in self.nodes if _takes(one))


def _takes(state: NodeState) -> bool:
    return state.load.ready and not state.draining and state.lease_left_s > 0
