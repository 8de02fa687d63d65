"""The directory as a node or an entry saw it last: which node owns which group."""

from typing import Final

from wayfarer.cluster.messages import ADOPTED, Changes, NodeInfo
from wayfarer.cluster.placement import rendezvous
from wayfarer.endpoint import Endpoint
from wayfarer.errors import Unavailable
from wayfarer.ids import group_of

MOST_PLACES: Final = 64


class GroupMap:
    """Kept up by `take`; still right in most things while the directory is away."""

    def __init__(self) -> None:
        self.seen = (0, 0)  # generation and version
        self._settled = True
        self.nodes: dict[str, NodeInfo] = {}
        self._places: dict[tuple[str, int], Endpoint] = {}  # by host and port, the latest last
        self._owners: dict[str, str] = {}

    def take(self, changes: Changes | None) -> None:
        """Enters changes since `seen`."""
        if changes is None:
            return
        self._settled = changes.settled
        if changes.whole:
            self._owners = {}
        for group, owner in changes.groups.items():
            if owner:
                self._owners[group] = owner
            else:
                self._owners.pop(group, None)
        if changes.nodes is not None:
            self.nodes = {node.name: node for node in changes.nodes}
            for node in changes.nodes:
                self._places.pop((node.host, node.http_port), None)
                self._places[node.host, node.http_port] = endpoint(node)
            for place in list(self._places)[:-MOST_PLACES]:
                del self._places[place]
        self.seen = (changes.generation, changes.version)

    @property
    def places(self) -> list[Endpoint]:
        """Former nodes, then the present ones; at most `MOST_PLACES`."""
        return list(self._places.values())

    def owner(self, name: str) -> NodeInfo | None:
        """The node that holds what has this id; None when no node is known to hold it.

        Raises Unavailable while that node is being started again or is silent, another one adopts
        it, or nodes have still to tell a directory that has started what they have.
        """
        owner = self._owners.get(group_of(name))
        if owner is not None and owner not in self.nodes:
            raise Unavailable(f"the node of {name!r} has ended or is silent; try again")
        if owner is None and not self._settled:
            raise Unavailable("not all nodes have come back to the directory; try again")
        return None if owner is None else self.nodes[owner]

    def is_not_of(self, node: str, group: str) -> bool:
        """Whether another node or nobody has this group; False while it is being adopted."""
        return self._settled and self._owners.get(group) not in (node, ADOPTED)

    def node_for(self, name: str) -> NodeInfo | None:
        """The owner, or the node that answers that there is nothing; None without any node.

        Raises as `owner`.
        """
        return self.owner(name) or self.nodes.get(rendezvous(group_of(name), self.nodes))


def endpoint(node: NodeInfo) -> Endpoint:
    """Where clients call the node."""
    return Endpoint(node.number, node.grpc_port, node.http_port, node.host)
