"""The public ports of a server, bound together so that a port in use is detected at once."""

import socket

from wayfarer.endpoint import bracketed
from wayfarer.errors import Unavailable


def bind(host: str, http_port: int, grpc_port: int) -> socket.socket:
    """Returns HTTP's listening socket if gRPC's port is free, too. Raises Unavailable."""
    # gRPC binds in C, which hides the cause of a failure and logs by itself, so this tries first.
    listen(host, grpc_port, "gRPC").close()
    return listen(host, http_port, "HTTP")


def http_url(host: str, bound: socket.socket, secure: bool) -> str:
    """The URL of the HTTP server."""
    return f"{'https' if secure else 'http'}://{bracketed(host)}:{bound.getsockname()[1]}"


def listen(host: str, port: int, what: str) -> socket.socket:
    """Opens a listening socket. Raises Unavailable."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family, backlog=1024)
    except OSError as error:
        raise Unavailable(
            f"cannot listen for {what} on {bracketed(host)}:{port}: {error.strerror}; "
            f"choose another with --{what.lower()}-port (0: any)"
        ) from None
