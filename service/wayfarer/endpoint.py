"""The address of a process of a service."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Endpoint:
    """One process of a service that has several, with its own ports."""

    worker: int  # its number, from 0
    grpc_port: int
    http_port: int  # of HTTP and WebSocket
    host: str = ""  # empty: the host at which the service was called

    def __str__(self) -> str:
        where = self.host or "this host"
        return f"port {self.grpc_port} (gRPC) or {self.http_port} (HTTP) of {where}"


def bracketed(host: str) -> str:
    """A host as URLs have it: an IPv6 address in brackets."""
    return f"[{host}]" if ":" in host else host
