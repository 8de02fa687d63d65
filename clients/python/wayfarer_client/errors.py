"""Errors of the client, one per kind of gRPC status that the server sends."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import grpc
from google.protobuf.message import DecodeError
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, RetryInfo
from google.rpc.status_pb2 import Status

from wayfarer_client.v1 import common_pb2

DETAILS: Final = "grpc-status-details-bin"


class WayfarerError(Exception):
    """Base of all errors. The text is the server's; it names the field at fault."""

    def __init__(self, message: str, field: str = "", retry_after: float = 0.0) -> None:
        super().__init__(message)
        self.field = field
        """Path of the field at fault, as in "goals[3].speed"; empty when none is."""
        self.retry_after = retry_after
        """Seconds after which the server may have time; 0 when it has not said."""


class InvalidArgument(WayfarerError):
    """A value is malformed or out of range."""


class NotFound(WayfarerError):
    """No such session, agent, body or model."""


class AlreadyExists(WayfarerError):
    """The name is taken."""


class FailedPrecondition(WayfarerError):
    """The request is valid, but not in the present state."""


class Unreachable(FailedPrecondition):
    """No way leads to the goal; `nearest` (x, y, z) is the closest place that can be reached."""

    nearest = (0.0, 0.0, 0.0)


class Misdirected(FailedPrecondition):
    """The session lives in another process of the server: at `grpc_port` of `host`.

    Clients follow that by themselves, once for each call.
    """

    host = ""
    """Empty: the host that was called."""
    grpc_port = 0


class Aborted(WayfarerError):
    """Another client was quicker: the agent no longer has the expected revision."""


class ResourceExhausted(WayfarerError):
    """A limit of the server is reached; `retry_after` says when to try again."""


class Unauthenticated(WayfarerError):
    """The key, token or certificate is missing or does not hold."""


class PermissionDenied(WayfarerError):
    """The caller is known, and its scopes do not allow the call."""


class Unavailable(WayfarerError):
    """No server answers, or it is starting, stopping or overloaded: try again later."""


class InternalError(WayfarerError):
    """The server failed; see its log."""


CLASSES: Final = {
    grpc.StatusCode.INVALID_ARGUMENT: InvalidArgument,
    grpc.StatusCode.NOT_FOUND: NotFound,
    grpc.StatusCode.ALREADY_EXISTS: AlreadyExists,
    grpc.StatusCode.FAILED_PRECONDITION: FailedPrecondition,
    grpc.StatusCode.ABORTED: Aborted,
    grpc.StatusCode.RESOURCE_EXHAUSTED: ResourceExhausted,
    grpc.StatusCode.UNAUTHENTICATED: Unauthenticated,
    grpc.StatusCode.PERMISSION_DENIED: PermissionDenied,
    grpc.StatusCode.UNAVAILABLE: Unavailable,
    grpc.StatusCode.DEADLINE_EXCEEDED: Unavailable,
    grpc.StatusCode.INTERNAL: InternalError,
}
_BY_NUMBER: Final = {code.value[0]: kind for code, kind in CLASSES.items()}


CALL_ENDED: Final = "Internal error from Core"
"""Text of grpc.aio when a call ends during a read or write; no server sends it."""


def from_grpc(error: grpc.aio.AioRpcError) -> WayfarerError:
    """The client's error for a failed call."""
    text = error.details() or error.code().name
    if text == CALL_ENDED:
        return Unavailable("the connection was lost")
    kind = CLASSES.get(error.code())
    if kind is None:
        return WayfarerError(f"{error.code().name}: {text}")
    found = _details(error)
    if found.grpc_port:
        kind = Misdirected
    if found.nearest is not None:
        kind = Unreachable
    made = kind(text, found.field, found.retry_after)
    if isinstance(made, Unreachable) and found.nearest is not None:
        made.nearest = found.nearest
    if isinstance(made, Misdirected):
        made.host, made.grpc_port = found.host, found.grpc_port
    return made


def from_problem(problem: common_pb2.Problem) -> WayfarerError:
    """The client's error for a failed command on a stream that continues."""
    if problem.HasField("nearest"):
        unreachable = Unreachable(problem.message, problem.field)
        unreachable.nearest = (problem.nearest.x, problem.nearest.y, problem.nearest.z)
        return unreachable
    kind = _BY_NUMBER.get(problem.code, WayfarerError)
    return kind(problem.message, problem.field)


class _Details(NamedTuple):
    field: str = ""  # at fault
    retry_after: float = 0.0  # seconds to wait
    grpc_port: int = 0  # where the call should have gone
    host: str = ""
    nearest: tuple[float, float, float] | None = None  # that can be reached


def _details(error: grpc.aio.AioRpcError) -> _Details:
    found = _Details()
    metadata: Any = error.trailing_metadata() or ()
    for key, value in metadata:
        if key != DETAILS or isinstance(value, str):
            continue
        try:
            details = Status.FromString(value).details
        except DecodeError:  # from a proxy: there is only the text
            continue
        for detail in details:
            bad, retry, info = BadRequest(), RetryInfo(), ErrorInfo()
            if detail.Unpack(bad) and bad.field_violations:
                found = found._replace(field=bad.field_violations[0].field)
            elif detail.Unpack(retry):
                seconds = retry.retry_delay.ToTimedelta().total_seconds()
                found = found._replace(retry_after=seconds)
            elif detail.Unpack(info) and info.metadata.get("grpc_port", "").isdigit():
                port, host = int(info.metadata["grpc_port"]), info.metadata.get("host", "")
                found = found._replace(grpc_port=port, host=host)
            elif detail.Unpack(info) and info.reason == "UNREACHABLE":
                found = found._replace(nearest=_place(info.metadata))
    return found


def _place(metadata: Mapping[str, str]) -> tuple[float, float, float] | None:
    try:
        return float(metadata["x"]), float(metadata["y"]), float(metadata["z"])
    except (KeyError, ValueError):  # no server of ours
        return None
