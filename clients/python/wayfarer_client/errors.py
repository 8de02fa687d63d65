"""Errors of the client, one per kind of gRPC status that the server sends."""

from typing import Final

import grpc


class WayfarerError(Exception):
    """Base of all. The text is the server's, which names the field at fault."""


class InvalidArgument(WayfarerError):
    """A value is malformed or out of range."""


class NotFound(WayfarerError):
    """No such session, agent or body."""


class AlreadyExists(WayfarerError):
    """The name is taken."""


class FailedPrecondition(WayfarerError):
    """Right request, wrong moment."""


class ResourceExhausted(WayfarerError):
    """A limit of the server is reached."""


class Unavailable(WayfarerError):
    """No server answers, or it is starting, stopping or overloaded: try again later."""


class InternalError(WayfarerError):
    """The server failed; its log tells more."""


CLASSES: Final = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidArgument,
    grpc.StatusCode.NOT_FOUND: NotFound,
    grpc.StatusCode.ALREADY_EXISTS: AlreadyExists,
    grpc.StatusCode.FAILED_PRECONDITION: FailedPrecondition,
    grpc.StatusCode.RESOURCE_EXHAUSTED: ResourceExhausted,
    grpc.StatusCode.UNAVAILABLE: Unavailable,
    grpc.StatusCode.DEADLINE_EXCEEDED: Unavailable,
    grpc.StatusCode.INTERNAL: InternalError,
}


def from_grpc(error: grpc.aio.AioRpcError) -> WayfarerError:
    """The client's error for a failed call."""
    kind = CLASSES.get(error.code())
    if kind is None:
        return WayfarerError(f"{error.code().name}: {error.details()}")
    return kind(error.details() or error.code().name)
