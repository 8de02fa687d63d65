"""Where a call goes when a server is many nodes: the rule of clients/README.md, "Many nodes".

No socket and no clock: answers go in, addresses come out.
"""

import re
from typing import Final

_SLOT: Final = re.compile(r"(?:session|scene|agent)-([0-9a-f]{4})")
_ENTRY: Final = re.compile(r"(https?://|)(\[[^\]]*\]|[^:]*)")
_HOST: Final = re.compile(r"[\w.:\[\]-]*", re.ASCII)
_REASON: Final = re.compile(r"call (.*):(\d{1,5})$")


class Homes:
    """The nodes at which sessions, scenes and agents live, as far as is known."""

    def __init__(self, entry: str) -> None:
        """`entry`: the server's address, "host:port" or "http://host:port"."""
        self.entry = entry
        self._homes: dict[str, str] = {}  # addresses by slot

    def home(self, about: str) -> str:
        """The address for calls about the id in `about`."""
        return self._homes.get(slot_of(about), self.entry)

    def node(self, host: str, port: int) -> str:
        """A node's address, by the entry's scheme. `host`: "" is the entry's."""
        found = _ENTRY.match(self.entry)
        assert found is not None  # it matches all
        if ":" in host and not host.startswith("["):
            host = f"[{host}]"  # IPv6
        return f"{found[1]}{host or found[2]}:{port}"

    def route(self, about: str) -> "Route":
        """The route of a call. `about`: text with the id that it concerns; "": none."""
        return Route(self, about)

    def learn(self, about: str, address: str) -> None:
        """Notes that the slot of `about` lives at `address`."""
        if slot := slot_of(about):
            self._homes[slot] = address

    def forget(self, about: str) -> None:
        """Forgets where it lives; only the entry knows."""
        self._homes.pop(slot_of(about), None)


class Route:
    """The addresses to which a call or a stream goes in turn: `address` is the next one.

    At most four: the known node, the node it names, the entry, and the node that the entry names.
    """

    def __init__(self, homes: Homes, about: str) -> None:
        self._homes = homes
        self._about = about
        self.begin()

    def begin(self) -> None:
        """Starts again, as for a new call."""
        self.address = self._homes.home(self._about)
        self._entry_tried = self.address == self._homes.entry
        self._followed = False

    def answered(self, made: str = "") -> None:
        """The call has succeeded, or the stream has begun. `made`: id of what was made by it."""
        if self.address != self._homes.entry:
            self._homes.learn(made if slot_of(made) else self._about, self.address)
        self.begin()

    def misdirected(self, host: str, port: int) -> bool:
        """Notes that `address` has named another node; returns whether the call continues there.

        Port 0, or an invalid host name: it has named none.
        """
        if self._followed or not 0 < port < 1 << 16 or not _HOST.fullmatch(host):
            return self._ask()
        self._followed = True
        self.address = self._homes.node(host, port)
        self._homes.learn(self._about, self.address)
        return True

    def unavailable(self) -> bool:
        """Notes that `address` does not answer at present; returns as `misdirected`."""
        return self._ask()

    def _ask(self) -> bool:
        self._homes.forget(self._about)
        if self._entry_tried:
            return False
        self._entry_tried, self._followed = True, False
        self.address = self._homes.entry
        return True


def slot_of(about: str) -> str:
    """The slot of the first id in a text, which a session and its agents share; or "".

    One node has everything of a slot.
    """
    found = _SLOT.search(about)
    return found[1] if found else ""


def place_of(reason: str) -> tuple[str, int]:
    """Host and port that the close reason of a stream names (code 4421); port 0: none."""
    found = _REASON.match(reason)
    return (found[1], int(found[2])) if found else ("", 0)
