"""What a node or an entry knows of the directory: who lives where, a moment ago."""

from wayfarer.cluster.directory import rendezvous
from wayfarer.cluster.messages import Changes, NodeInfo
from wayfarer.endpoint import Endpoint
from wayfarer.ids import slot_of


class SlotMap:
    """Kept up by `take`; still right in most things while the directory is away."""

    def __init__(self) -> None:
        self.seen = (0, 0)  # generation and version
        self.nodes: dict[str, NodeInfo] = {}
        self._owners: dict[int, str] = {}

    def take(self, changes: Changes | None) -> None:
        """Enter changes since `seen`."""
        if changes is None:
            return
        if changes.whole:
            self._owners = {}
        for slot, owner in changes.slots.items():
            if owner:
                self._owners[slot] = owner
            else:
                self._owners.pop(slot, None)
        if changes.nodes is not None:
            self.nodes = {node.name: node for node in changes.nodes}
        self.seen = (changes.generation, changes.version)

    def owner(self, name: str) -> NodeInfo | None:
        """The node that has what has this id; None: nobody is known to."""
        return self.nodes.get(self._owners.get(slot_of(name), ""))

    def node_for(self, name: str) -> NodeInfo | None:
        """The owner, or the node that answers that there is nothing; None without any node."""
        return self.owner(name) or self.nodes.get(rendezvous(slot_of(name), self.nodes))


def endpoint(node: NodeInfo) -> Endpoint:
    """Where it is called."""
    return Endpoint(node.number, node.grpc_port, node.http_port, node.host)
