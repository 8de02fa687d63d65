"""Protobuf ↔ schema, by field name: any message and its twin in schema/.

As values, enums are their short lower-case names, and bytes are base64 text.
"""

import asyncio
import inspect
from base64 import b64decode, b64encode
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable
from contextlib import aclosing
from typing import Any, Final, TypeVar

import grpc
from google.protobuf.message import DecodeError
from google.protobuf.message import Message as ProtoMessage
from google.protobuf.message_factory import GetMessageClass
from pydantic import BaseModel, ValidationError

from wayfarer.errors import InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.contract import Rpc, twin_of
from wayfarer.transport.conversion.violations import invalid_request
from wayfarer.v1 import common_pb2

MAX_ITEMS: Final = 2048
"""Maximum items of a list in a request; no schema allows more."""

VECTOR: Final = common_pb2.Vector3.DESCRIPTOR

Twin = TypeVar("Twin", bound=BaseModel)
Proto = TypeVar("Proto", bound=ProtoMessage)


def from_message(call: Rpc, method: Callable[..., Any]) -> Callable[[Any], Any]:
    """Wraps a method of the gateway as a function of the protobuf request.

    Fields of the request are arguments by name. A parameter whose type is a class of schema/ takes
    the body, which is the whole request unless the options say otherwise.
    """
    body = call.options.body
    twins = {
        name: twin_of(parameter) for name, parameter in inspect.signature(method).parameters.items()
    }
    fields = call.request.DESCRIPTOR.fields_by_name

    def argument(request: Any, name: str, twin: type[BaseModel] | None) -> Any:
        if twin is not None:
            return parse(twin, getattr(request, body) if body else request, body)
        is_absent = fields[name].has_presence and not request.HasField(name)
        return None if is_absent else getattr(request, name)

    return lambda request: method(**{n: argument(request, n, twin) for n, twin in twins.items()})


def handler(method: Any, call: Callable[[Any], Any]) -> grpc.RpcMethodHandler:
    """Carries an RPC out by a function of its request. This returns the value from which `answer`
    makes the response: a coroutine of it or, if the RPC streams, a generator of messages.

    A cancelled call closes its generator, and so the subscription. CancelledError is never
    swallowed, since grpc.aio leaks such calls (grpc/grpc#43360).
    """
    kind, response = GetMessageClass(method.input_type), GetMessageClass(method.output_type)

    def read(sent: Any) -> Any:
        if method.client_streaming:
            return (_decoded(kind, data) async for data in sent)
        return _decoded(kind, sent)

    async def unary(sent: Any, _: Any) -> Any:
        given = call(read(sent))
        found = await given if isinstance(given, Awaitable) else given
        if isinstance(found, schema.SceneOutlines):  # large ones take long
            return await asyncio.to_thread(answer, response, found)
        return answer(response, found)

    async def stream(sent: Any, _: Any) -> AsyncGenerator[Any]:
        async with aclosing(call(read(sent))) as messages:
            async for message in messages:
                yield message

    kinds = {
        (False, False): (grpc.unary_unary_rpc_method_handler, unary),
        (False, True): (grpc.unary_stream_rpc_method_handler, stream),
        (True, False): (grpc.stream_unary_rpc_method_handler, unary),
        (True, True): (grpc.stream_stream_rpc_method_handler, stream),
    }
    make, behaviour = kinds[method.client_streaming, method.server_streaming]
    return make(behaviour, None, _encoded)


def _decoded(kind: type[Proto], data: bytes) -> Proto:
    """Parses a request here, since gRPC itself would report a malformed one as INTERNAL."""
    try:
        return kind.FromString(data)
    except DecodeError:
        raise InvalidArgument("not a protobuf message of this call; see proto/") from None


def _encoded(message: ProtoMessage | bytes) -> bytes:
    return message if isinstance(message, bytes) else message.SerializeToString()


def parse(twin: type[Twin], message: ProtoMessage, field: str = "") -> Twin:
    """Converts a protobuf message, which is the `field` of a request, to its schema twin.

    Fields that the twin does not have are ignored. Raises InvalidArgument.
    """
    found = values(message, field)
    try:
        return twin.model_validate({k: v for k, v in found.items() if k in twin.model_fields})
    except ValidationError as error:
        raise invalid_request(error, field, twin) from None


async def first(requests: AsyncIterator[Any], payload: str, seconds: float, hint: str) -> Any:
    """Returns the `payload` of the first message, which must come within `seconds`.

    Raises InvalidArgument with `hint`.
    """
    wrong = InvalidArgument(hint, payload)
    try:
        async with asyncio.timeout(seconds):
            found = await anext(requests)
    except (TimeoutError, StopAsyncIteration):
        raise wrong from None
    if found.WhichOneof("payload") != payload:
        raise wrong
    return getattr(found, payload)


def message(kind: type[Proto], twin: BaseModel) -> Proto:
    """Converts a schema twin to the protobuf message."""
    return kind(**_arguments(kind.DESCRIPTOR, twin.model_dump()))


def answer(kind: type[Proto], found: Any) -> Proto:
    """The response that holds a call's result: a message, a twin, bytes, a number, or nothing.

    A twin becomes the response itself if they have the same fields, otherwise its first field.
    """
    if found is None or isinstance(found, kind):
        return found or kind()
    fields = kind.DESCRIPTOR.fields
    if not isinstance(found, BaseModel):
        return kind(**{fields[0].name: found})
    if set(type(found).model_fields) <= set(kind.DESCRIPTOR.fields_by_name):
        return message(kind, found)
    return kind(**{fields[0].name: _arguments(fields[0].message_type, found.model_dump())})


def values(message: ProtoMessage, path: str = "") -> dict[str, Any]:
    """Fields by name. Missing ones and unspecified enums are left to the twin's defaults.

    Raises InvalidArgument if an enum's number is unknown, or a list is too long.
    """
    found: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        inner = f"{path}.{field.name}" if path else field.name
        if field.is_repeated:
            if len(value) > MAX_ITEMS:
                raise InvalidArgument(f"has {len(value)} items; allowed: {MAX_ITEMS}", inner)
            found[field.name] = [_value(field, v, f"{inner}[{i}]") for i, v in enumerate(value)]
        elif (
            message.HasField(field.name) if field.has_presence else field.enum_type is None or value
        ):
            found[field.name] = _value(field, value, inner)
    return found


def _value(field: Any, value: Any, path: str) -> Any:
    if field.enum_type is not None:
        return _enum_name(field.enum_type, value, path)
    if field.type == field.TYPE_BYTES:
        return b64encode(value).decode()
    if field.message_type is VECTOR:  # there may be thousands
        return {"x": value.x, "y": value.y, "z": value.z}
    return value if field.message_type is None else values(value, path)


def _arguments(descriptor: Any, values: dict[str, Any]) -> dict[str, Any]:
    """Constructor arguments of a protobuf message; None stands for a missing field."""
    arguments: dict[str, Any] = {}
    for name, value in values.items():
        field = descriptor.fields_by_name[name]
        if field.is_repeated:
            arguments[name] = [_argument(field, item) for item in value]
        elif value is not None:
            arguments[name] = _argument(field, value)
    return arguments


def _argument(field: Any, value: Any) -> Any:
    if field.enum_type is not None:
        return f"{_prefix(field.enum_type)}{value.upper()}"
    if field.type == field.TYPE_BYTES:
        return b64decode(value)
    return value if field.message_type is None else _arguments(field.message_type, value)


def _enum_name(enum: Any, number: int, path: str) -> str:
    value = enum.values_by_number.get(number)
    if value is None or number == 0:
        known = [v.name for v in enum.values[1:]]
        raise InvalidArgument(f"{number} is none of {', '.join(known)}", path)
    return str(value.name).removeprefix(_prefix(enum)).lower()


def _prefix(enum: Any) -> str:
    """The prefix of an enum's values, which buf's STANDARD rules require: "GENDER_"."""
    return str(enum.values[0].name).removesuffix("UNSPECIFIED")
