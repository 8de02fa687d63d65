"""The one table that turns errors into gRPC statuses and HTTP problems."""

import math
import re
from dataclasses import asdict, dataclass
from http import HTTPStatus
from typing import Any, Final

import grpc
from google.protobuf.any_pb2 import Any as AnyMessage
from google.protobuf.duration_pb2 import Duration
from google.rpc.error_details_pb2 import (
    BadRequest,
    ErrorInfo,
    QuotaFailure,
    ResourceInfo,
    RetryInfo,
)
from google.rpc.status_pb2 import Status
from grpc_status import rpc_status

from wayfarer import errors

DOMAIN: Final = "wayfarer"
PROBLEM_JSON: Final = "application/problem+json"

REASON_BYTES: Final = 123
"""RFC 6455, 5.5: a control frame has 125 bytes, two of them the code."""


@dataclass(frozen=True, slots=True)
class Code:
    """One kind of failure on both transports."""

    grpc: grpc.StatusCode
    http: HTTPStatus
    title: str
    name: str = ""  # if it differs from the status's

    @property
    def reason(self) -> str:
        """Upper snake case name, the same on both transports."""
        return self.name or self.grpc.name


TABLE: Final[dict[type[errors.WayfarerError], Code]] = {
    errors.InvalidArgument: Code(
        grpc.StatusCode.INVALID_ARGUMENT, HTTPStatus.UNPROCESSABLE_ENTITY, "Invalid argument"
    ),
    errors.NotFound: Code(grpc.StatusCode.NOT_FOUND, HTTPStatus.NOT_FOUND, "Not found"),
    errors.AlreadyExists: Code(
        grpc.StatusCode.ALREADY_EXISTS, HTTPStatus.CONFLICT, "Already exists"
    ),
    errors.FailedPrecondition: Code(
        grpc.StatusCode.FAILED_PRECONDITION, HTTPStatus.CONFLICT, "Failed precondition"
    ),
    errors.Unreachable: Code(
        grpc.StatusCode.FAILED_PRECONDITION, HTTPStatus.CONFLICT, "Unreachable", "UNREACHABLE"
    ),
    errors.Misdirected: Code(
        grpc.StatusCode.FAILED_PRECONDITION,
        HTTPStatus.MISDIRECTED_REQUEST,
        "Misdirected",
        "MISDIRECTED",
    ),
    errors.Aborted: Code(grpc.StatusCode.ABORTED, HTTPStatus.CONFLICT, "Aborted"),
    errors.Unauthenticated: Code(
        grpc.StatusCode.UNAUTHENTICATED, HTTPStatus.UNAUTHORIZED, "Unauthenticated"
    ),
    errors.PermissionDenied: Code(
        grpc.StatusCode.PERMISSION_DENIED, HTTPStatus.FORBIDDEN, "Permission denied"
    ),
    errors.ResourceExhausted: Code(
        grpc.StatusCode.RESOURCE_EXHAUSTED, HTTPStatus.TOO_MANY_REQUESTS, "Limit reached"
    ),
    errors.Unavailable: Code(
        grpc.StatusCode.UNAVAILABLE, HTTPStatus.SERVICE_UNAVAILABLE, "Unavailable"
    ),
}
INTERNAL: Final = Code(grpc.StatusCode.INTERNAL, HTTPStatus.INTERNAL_SERVER_ERROR, "Internal error")
"""All other errors: their text stays in the server's log."""

TOO_LARGE: Final = Code(
    grpc.StatusCode.RESOURCE_EXHAUSTED, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "Request too large"
)
"""The servers send it before they read a request; gRPC sends it without details."""

COMPRESSED: Final = Code(
    grpc.StatusCode.UNIMPLEMENTED, HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "Unsupported media type"
)
"""The answer to a compressed request; gRPC unpacks the codings that it knows, within limits."""


MAX_VIOLATIONS: Final = 16
"""Maximum number of violations in the error of one request."""


class InvalidRequest(errors.InvalidArgument):
    """Several fields of a request are wrong; `violations` are (field, what is wrong)."""

    def __init__(self, violations: list[tuple[str, str]], more: int = 0) -> None:
        """`more`: number of violations in addition to these."""
        text = "; ".join(f"{field}: {what}" if field else what for field, what in violations)
        if more:
            text += f"; and {more} more"
        super().__init__(text, violations[0][0])
        self.violations = violations


def code_of(error: BaseException) -> Code:
    """The row of the nearest class of the error."""
    return next((TABLE[kind] for kind in type(error).__mro__ if kind in TABLE), INTERNAL)


def message_of(error: BaseException) -> str:
    """The text for the caller, with the field at fault, since some callers see only this."""
    if code_of(error) is INTERNAL:
        return "internal error; the server's log tells more"
    text = str(error)
    field = error.field if isinstance(error, errors.InvalidArgument) else ""
    if not field or re.search(rf"(?<![\w.]){re.escape(field)}(?!\w)", text):
        return text
    return f"{field}: {text}"


def violations_of(error: BaseException) -> list[tuple[str, str]]:
    """(field, what is wrong) for an error about arguments; empty for others."""
    if isinstance(error, InvalidRequest):
        return error.violations if error.field else []  # of the request as a whole
    if isinstance(error, errors.InvalidArgument) and error.field:
        return [(error.field, str(error))]
    return []


def endpoint_of(error: BaseException) -> dict[str, int | str]:
    """The right address for the call; empty for errors of another kind."""
    return asdict(error.endpoint) if isinstance(error, errors.Misdirected) else {}


def nearest_of(error: BaseException) -> dict[str, float]:
    """The nearest place that can be reached; empty for errors of another kind."""
    if not isinstance(error, errors.Unreachable):
        return {}
    return dict(zip("xyz", error.nearest, strict=True))


def retry_after(error: BaseException) -> float:
    """Seconds after which to try again; 0 if that is no use."""
    if isinstance(error, errors.ResourceExhausted):
        return error.retry_after
    return 1.0 if isinstance(error, errors.Unavailable) else 0.0


def to_grpc(error: BaseException) -> grpc.Status:
    """The status that ends a call, with google.rpc details."""
    code = code_of(error)
    places = {**endpoint_of(error), **nearest_of(error)}
    where = {key: str(value) for key, value in places.items()}
    details: list[Any] = [ErrorInfo(reason=code.reason, domain=DOMAIN, metadata=where)]
    if violations := violations_of(error):
        fields = [BadRequest.FieldViolation(field=f, description=d) for f, d in violations]
        details.append(BadRequest(field_violations=fields))
    if isinstance(error, errors.ResourceExhausted):
        details.append(QuotaFailure(violations=[{"subject": DOMAIN, "description": str(error)}]))
    if isinstance(error, errors.NotFound) and error.kind:
        details.append(
            ResourceInfo(resource_type=error.kind, resource_name=error.name, description=str(error))
        )
    if seconds := retry_after(error):
        delay = Duration()
        delay.FromMilliseconds(round(seconds * 1000))
        details.append(RetryInfo(retry_delay=delay))
    status = Status(code=code.grpc.value[0], message=message_of(error))
    for detail in details:
        packed = AnyMessage()
        packed.Pack(detail)
        status.details.append(packed)
    return rpc_status.to_status(status)


def headers_of(error: BaseException) -> dict[str, str]:
    """HTTP headers that belong to the answer."""
    headers = {}
    if seconds := retry_after(error):
        headers["retry-after"] = str(max(1, math.ceil(seconds)))
    if isinstance(error, errors.Unauthenticated):
        headers["www-authenticate"] = f'Bearer realm="{DOMAIN}"'
    return headers


def to_problem(error: BaseException) -> dict[str, Any]:
    """The RFC 9457 problem document."""
    code = code_of(error)
    problem: dict[str, Any] = {
        "type": f"urn:{DOMAIN}:{code.reason.lower()}",
        "title": code.title,
        "status": int(code.http),
        "detail": message_of(error),
    }
    if violations := violations_of(error):
        problem["errors"] = [{"field": f, "detail": d} for f, d in violations]
    if seconds := retry_after(error):
        problem["retry_after_s"] = seconds
    if endpoint := endpoint_of(error):
        problem["endpoint"] = endpoint
    if nearest := nearest_of(error):
        problem["nearest"] = nearest
    return problem


def http_problem(status: int, detail: str) -> dict[str, Any]:
    """The problem document of a failure of HTTP itself, such as a path that does not exist."""
    phrase = HTTPStatus(status).phrase
    return {"type": "about:blank", "title": phrase, "status": int(status), "detail": detail}


def close_code(error: BaseException) -> int:
    """WebSocket close code: 4000 + HTTP status, in the range reserved for applications."""
    return 4000 + int(code_of(error).http)


def close_reason(error: BaseException) -> str:
    """WebSocket close reason: the message, or the right address of a misdirected call."""
    reason = message_of(error)
    if isinstance(error, errors.Misdirected):
        reason = f"call {error.endpoint.host}:{error.endpoint.http_port}"
    return reason.encode()[:REASON_BYTES].decode(errors="ignore")


def log_unexpected(log: Any, error: BaseException, where: str) -> None:
    """Logs an error that was not raised on purpose, with its traceback."""
    if code_of(error) is INTERNAL:
        log.error("request failed", where=where, exc_info=error)
