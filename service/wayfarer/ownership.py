"""Owners of sessions, scenes and agents, as known to one node."""

from collections.abc import Sequence
from typing import Protocol

from wayfarer.endpoint import Endpoint
from wayfarer.ids import new_group


class Ownership(Protocol):
    """The event loop and the motion thread ask it for every call and turn. It answers from memory,
    at once, and from any thread.
    """

    @property
    def own(self) -> Endpoint | None:
        """The address of this node; None: the address that its clients know."""
        ...

    @property
    def nodes(self) -> Sequence[Endpoint]:
        """All nodes that share the sessions, and recent ones: a page of a node that has ended
        continues at others.
        """
        ...

    def endpoint_of(self, name: str) -> Endpoint | None:
        """The node that owns this id. None: this node, or unknown."""
        ...

    def new_group(self) -> str:
        """The group of a new session or scene; this node owns it."""
        ...

    async def claimed(self, name: str) -> None:
        """Returns once other nodes and entries find a new session or scene, and it is `copied`."""
        ...

    async def copied(self, name: str) -> None:
        """Returns once another node has the present state of a session or scene, or knows that it
        has ended, so that the change is not lost with this node. On the event loop.
        """
        ...

    def may_step(self) -> bool:
        """Whether the node's lease holds: it alone owns its slots.

        False: it must not step, publish or change anything. It may become true again only after
        everything that now has another owner is released.
        """
        ...

    def epoch(self, session_id: str) -> int:
        """Epoch of the ownership of the session's group, which grows with every owner."""
        ...


class SingleNode:
    """A server alone: everything lives here, and always may. Implements `Ownership`."""

    own: Endpoint | None = None
    nodes: Sequence[Endpoint] = ()

    def endpoint_of(self, name: str) -> Endpoint | None:
        """None: this server, or nowhere."""
        return None

    def new_group(self) -> str:
        """A new group."""
        return new_group()

    async def claimed(self, name: str) -> None:
        """Returns at once."""

    async def copied(self, name: str) -> None:
        """Returns at once: there is no other node."""

    def may_step(self) -> bool:
        """Always."""
        return True

    def epoch(self, session_id: str) -> int:
        """0: there is no other owner."""
        return 0
