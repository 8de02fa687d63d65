"""Which web pages may call, and which host names the server accepts."""

import re
import socket
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Final
from urllib.parse import urlsplit

from wayfarer.endpoint import Endpoint, bracketed

_ORIGIN: Final = re.compile(r"https?://([\w.-]+|\[[0-9A-Fa-f:.]+\])(?::\d{1,5})?")

LOOPBACK: Final = r"https?://(([\w-]+\.)*localhost|127(\.\d{1,3}){3}|\[::1\])(:\d{1,5})?"
"""Origins of pages from this machine, as a regular expression; see `is_this_machine`."""

ANY: Final = "*"
"""Entry of `names` that stands for all names."""


@dataclass(frozen=True, slots=True)
class Origins:
    """The rules for the headers `Origin` and `Host` that browsers send."""

    listed: frozenset[str] = frozenset()  # origins of other pages, for example https://example.org
    names: frozenset[str] | None = frozenset()  # of the server, in lower case; None: any will do
    nodes: tuple[str, ...] = ()  # hosts of a cluster's nodes that may come; *.example.org: below it

    def is_name(self, host: str) -> bool:
        """Whether `host`, a Host header with or without port, is a name of this server.

        A server that asks for no credentials requires this. A page whose own name is made to point
        to this machine (DNS rebinding) has the server's origin to its browser, which lets it read
        every answer; but `Host` has the page's name. An address cannot be made to point elsewhere,
        so all addresses are names of this server.
        """
        if self.names is None or ANY in self.names:
            return True
        try:
            name = (urlsplit(f"//{host}").hostname or "").removesuffix(".")
        except ValueError:  # not a host
            return False
        return name in self.names or _is_address(name) or is_this_machine(name)

    def allows(self, origin: str | None, host: str) -> bool:
        """Whether a page of `origin` may change something, or open a socket.

        A page of the server itself has `host` as its host. Programs other than browsers send no
        origin.
        """
        if origin is None or origin in self.listed:
            return True
        try:
            parts = urlsplit(origin)
            return is_this_machine(parts.hostname or "") or parts.netloc == host
        except ValueError:  # not a URL
            return False


def places_of(nodes: Iterable[Endpoint], host: str) -> list[str]:
    """Host and port of each, in the form of an origin; `host`: the Host header of the call."""
    try:
        own = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        own = ""
    return [f"{bracketed(node.host or own)}:{node.http_port}" for node in nodes]


def machines_of(places: Iterable[str], later: Iterable[str] = ()) -> list[str]:
    """The hosts of these and of nodes that may come `later`, whose nodes may use any port."""
    return list(dict.fromkeys((*(place.rpartition(":")[0] for place in places), *later)))


def is_page_of(origin: str, machines: Collection[str]) -> bool:
    """Whether a page of `origin` comes from one of these machines."""
    found = _ORIGIN.fullmatch(origin)
    if found is None:
        return False
    host = found[1].lower()
    return host in machines or any(
        machine.startswith("*.") and host.endswith(machine[1:]) for machine in machines
    )


def own_names() -> frozenset[str]:
    """Names of this machine, in its own network and in multicast DNS."""
    name = socket.gethostname().lower()
    return frozenset({name, f"{name}.local"})


def is_this_machine(host: str) -> bool:
    """Whether a host name or address is loopback's."""
    if host == "localhost" or host.endswith(".localhost"):
        return True
    return _is_address(host) and ip_address(host).is_loopback


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True
