"""Who owns which session, scene and agent, as one node knows it."""

from collections.abc import Sequence
from typing import Protocol

from wayfarer.endpoint import Endpoint
from wayfarer.ids import any_slot


class Ownership(Protocol):
    """Asked on the event loop and on the motion thread for every call and turn: it answers from
    memory, at once, and from any thread.
    """

    @property
    def own(self) -> Endpoint | None:
        """Where this node is called; None: at the address that its clients know."""
        ...

    @property
    def nodes(self) -> Sequence[Endpoint]:
        """All that share the sessions, and those that did lately: a page of one that has ended
        goes on at others.
        """
        ...

    def endpoint_of(self, name: str) -> Endpoint | None:
        """Where what has this id lives. None: here, or nowhere that is known."""
        ...

    def new_key(self) -> int:
        """The slot for a new session or scene, one that this node owns."""
        ...

    def may_step(self) -> bool:
        """The node's lease holds: what it owns is nobody else's.

        False: it must neither step nor publish nor change anything. It may become true again only
        after everything that has another owner by now was released.
        """
        ...

    def epoch(self, session_id: str) -> int:
        """Of the ownership of the session's slot: greater with every owner."""
        ...


class SingleNode:
    """A server alone: everything lives here, and always may. Implements `Ownership`."""

    own: Endpoint | None = None
    nodes: Sequence[Endpoint] = ()

    def endpoint_of(self, name: str) -> Endpoint | None:
        """None: here, or nowhere."""
        return None

    def new_key(self) -> int:
        """Any."""
        return any_slot()

    def may_step(self) -> bool:
        """Always."""
        return True

    def epoch(self, session_id: str) -> int:
        """0: there is no other owner."""
        return 0
