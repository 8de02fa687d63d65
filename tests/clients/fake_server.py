"""A gRPC server with answers from the test, for rare behaviour of a real one."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import grpc
from google.protobuf.any_pb2 import Any as AnyMessage
from google.protobuf.message_factory import GetMessageClass
from google.rpc.status_pb2 import Status

CONTRACT = ("admin", "agent", "catalog", "control", "goal", "motion", "session", "snapshot")
MODULES = [import_module(f"wayfarer_client.v1.{name}_pb2") for name in CONTRACT]
ASKED = "asked"  # in a script: read one request of the client
FOREVER = "forever"  # in a script: send nothing more


@dataclass
class Refusal(Exception):  # noqa: N818, as in errors.py
    """A call fails with this status."""

    code: grpc.StatusCode
    text: str = ""
    details: tuple[Any, ...] = ()


class FakeServer:
    """`answers[method]` gives the reply to a request; `scripts[method]` one list per stream."""

    def __init__(self, credentials: grpc.ServerCredentials | None = None) -> None:
        self._credentials = credentials
        self.requests: list[tuple[str, Any]] = []
        self.metadata: list[dict[str, str]] = []
        self.answers: dict[str, Callable[[Any], Any]] = {}
        self.scripts: dict[str, list[list[Any]]] = {}
        self.address = ""

    def asked(self, method: str) -> list[Any]:
        """Requests of one method."""
        return [request for name, request in self.requests if name == method]

    async def __aenter__(self) -> "FakeServer":
        self._server = grpc.aio.server()
        for module in MODULES:
            for service in module.DESCRIPTOR.services_by_name.values():
                methods = {method.name: self._handler(method) for method in service.methods}
                handler = grpc.method_handlers_generic_handler(service.full_name, methods)
                self._server.add_generic_rpc_handlers((handler,))
        where = "127.0.0.1:0"
        if self._credentials is None:
            port = self._server.add_insecure_port(where)
        else:
            port = self._server.add_secure_port(where, self._credentials)
        self.address = f"127.0.0.1:{port}"
        await self._server.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._server.stop(0)

    def _handler(self, method: Any) -> Any:
        request, reply = GetMessageClass(method.input_type), GetMessageClass(method.output_type)
        coding = (request.FromString, reply.SerializeToString)
        name = method.name

        async def unary(message: Any, context: Any) -> Any:
            self._note(name, message, context)
            answer = self.answers.get(name, lambda _: reply())
            try:
                return answer(message)
            except Refusal as refusal:
                await _refuse(context, refusal)

        async def stream(message: Any, context: Any) -> None:
            self._note(name, message, context)
            await self._play(name, context, None)

        async def both(messages: Any, context: Any) -> None:
            self.metadata.append(dict(context.invocation_metadata()))
            await self._play(name, context, messages)

        if method.client_streaming:
            return grpc.stream_stream_rpc_method_handler(both, *coding)
        if method.server_streaming:
            return grpc.unary_stream_rpc_method_handler(stream, *coding)
        return grpc.unary_unary_rpc_method_handler(unary, *coding)

    def _note(self, name: str, message: Any, context: Any) -> None:
        self.requests.append((name, message))
        self.metadata.append(dict(context.invocation_metadata()))

    async def _play(self, name: str, context: Any, messages: Any) -> None:
        script = self.scripts[name].pop(0) if self.scripts.get(name) else [FOREVER]
        asked = None
        for step in script:
            if step is ASKED:
                asked = await anext(messages)
                self.requests.append((name, asked))
            elif step is FOREVER:
                await asyncio.sleep(3600)
            elif isinstance(step, Refusal):
                await _refuse(context, step)
            else:
                await context.write(step(asked) if callable(step) else step)


async def _refuse(context: Any, refusal: Refusal) -> None:
    packed = []
    for detail in refusal.details:
        packed.append(AnyMessage())
        packed[-1].Pack(detail)
    status = Status(code=refusal.code.value[0], message=refusal.text, details=packed)
    trailing = (("grpc-status-details-bin", status.SerializeToString()),) if packed else ()
    await context.abort(refusal.code, refusal.text, trailing)
