"""The calls of the API as the protos define them: messages, scope, HTTP route, routing.

`options.proto` explains the options. gRPC, HTTP and the cluster's entry all read this table.
"""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from pydantic import BaseModel

from wayfarer.transport.edge.caller import Scope
from wayfarer.v1 import (
    admin_pb2,
    agent_pb2,
    catalog_pb2,
    control_pb2,
    goal_pb2,
    motion_pb2,
    options_pb2,
    scene_pb2,
    session_pb2,
    snapshot_pb2,
)

FILES: Final = (
    *(scene_pb2, session_pb2, agent_pb2, goal_pb2, motion_pb2, control_pb2, snapshot_pb2),
    *(catalog_pb2, admin_pb2),
)


@dataclass(frozen=True, slots=True)
class Rpc:
    """One RPC."""

    name: str
    path: str  # /package.Service/Method
    request: type[Message]
    response: type[Message]
    options: options_pb2.CallOptions
    tag: str  # its group in the OpenAPI document
    deprecated: bool

    @property
    def scope(self) -> Scope:
        """The scope that the caller needs."""
        name = options_pb2.CallOptions.Scope.Name(self.options.scope)
        return Scope(name.removeprefix("SCOPE_").lower())

    @property
    def route(self) -> tuple[str, str]:
        """HTTP verb and path; both are empty for a call without a route."""
        verb, _, path = self.options.route.partition(" ")
        return verb, path

    @property
    def operation_id(self) -> str:
        """Its name in the OpenAPI document."""
        return self.name[0].lower() + self.name[1:]

    @property
    def status(self) -> int:
        """HTTP status of its answer."""
        return self.options.status or (200 if self.response.DESCRIPTOR.fields else 204)


def _calls() -> Mapping[str, Rpc]:
    found = {}
    for file in FILES:
        for service in file.DESCRIPTOR.services_by_name.values():
            tag = service.GetOptions().Extensions[options_pb2.tag]
            for method in service.methods:
                options = method.GetOptions().Extensions[options_pb2.call]
                deprecated = method.GetOptions().deprecated
                found[method.name] = Rpc(
                    method.name,
                    f"/{service.full_name}/{method.name}",
                    GetMessageClass(method.input_type),
                    GetMessageClass(method.output_type),
                    options,
                    options.tag or tag,
                    deprecated,
                )
    return found


CALLS: Final = _calls()
"""All RPCs, by name."""


def twin_of(parameter: inspect.Parameter) -> type[BaseModel] | None:
    """The class of schema/ that a parameter takes, if it takes one."""
    kind = parameter.annotation
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None
