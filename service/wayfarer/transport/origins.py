"""Which web pages may call: those of this server, of this machine, and of a list."""

from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import urlsplit


@dataclass(frozen=True, slots=True)
class Origins:
    """The rule for the `Origin` header that browsers send.

    A page of the server itself is one whose host is that of the request. On a server that asks
    for no credentials and listens on loopback, that host must be this machine's own, too: else a
    foreign name that is made to point here (DNS rebinding) would do.
    """

    listed: frozenset[str] = frozenset()  # as https://example.org
    local_only: bool = True

    def allows(self, origin: str | None, host: str) -> bool:
        """`host`: the request's Host header. Programs send no origin: none is a browser's."""
        if origin is None or origin in self.listed:
            return True
        try:
            parts = urlsplit(origin)
            if is_this_machine(parts.hostname or ""):
                return True
        except ValueError:  # no URL
            return False
        return parts.netloc == host and not self.local_only


def is_this_machine(host: str) -> bool:
    """Whether a host name or address is loopback's."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")
