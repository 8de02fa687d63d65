"""The sessions, scenes and agents that a server owns, and the addresses of the others."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import asdict
from typing import Final

from wayfarer.endpoint import Endpoint
from wayfarer.errors import Misdirected, Unavailable
from wayfarer.ids import group_of
from wayfarer.ownership import Ownership, SingleNode
from wayfarer.transport import schema

REMEMBERED: Final = 4096
"""Maximum number of groups that left and are remembered until the ownership knows of it."""


class SessionLocator:
    """The ownership, and the groups that have left this server since."""

    def __init__(self, ownership: Ownership | None = None) -> None:
        self._ownership = ownership or SingleNode()
        self._left: OrderedDict[str, Endpoint] = OrderedDict()  # by group

    @property
    def own(self) -> schema.Endpoint | None:
        """The address of this server. None means that clients keep the address that they use."""
        own = self._ownership.own
        return None if own is None else schema.Endpoint(**asdict(own))

    @property
    def nodes(self) -> Sequence[Endpoint]:
        """See `Ownership`."""
        return self._ownership.nodes

    @property
    def holds(self) -> bool:
        """Whether the lease is valid, so that owned groups may be changed."""
        return self._ownership.may_step()

    def require_lease(self) -> None:
        """Raises Unavailable while this node must not change what it owns."""
        if not self.holds:
            raise Unavailable("this node has lost touch with its cluster; try again")

    def require_own(self, name: str) -> None:
        """Raises Misdirected if this id belongs to another server.

        Called for groups that are not on this server; a group that came back is found before.
        """
        right = self._ownership.endpoint_of(name) or self._left.get(group_of(name))
        if right is not None:
            raise misdirected(name, right)

    async def claimed(self, name: str) -> None:
        """See `Ownership`."""
        await self._ownership.claimed(name)

    async def copied(self, name: str) -> None:
        """See `Ownership`. Raises Unavailable if the lease has ended meanwhile: another node may
        continue without the change.
        """
        await self._ownership.copied(name)
        self.require_lease()

    def left(self, name: str, endpoint: Endpoint) -> None:
        """Records that a session or scene has moved to `endpoint`."""
        group = group_of(name)
        self._left[group] = endpoint
        self._left.move_to_end(group)
        while len(self._left) > REMEMBERED:
            self._left.popitem(last=False)

    def came(self, name: str) -> None:
        """Records that a session or scene has come to this server."""
        self._left.pop(group_of(name), None)


def misdirected(name: str, right: Endpoint) -> Misdirected:
    """The error with the right address."""
    return Misdirected(f"{name!r} lives in node {right.worker}; call {right}", right)
