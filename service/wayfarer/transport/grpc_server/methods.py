"""The RPCs over the gateway, see `wire.handler`."""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from functools import partial
from typing import Any, Final

import grpc

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.scene_spec import MAX_POINTS
from wayfarer.transport import schema
from wayfarer.transport.contract import CALLS, FILES
from wayfarer.transport.conversion.motion_files import parts_of
from wayfarer.transport.conversion.wire import first, from_message, handler, parse
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.streams.control import control
from wayfarer.v1 import scene_pb2, snapshot_pb2

HEADER_S: Final = 10.0
"""Seconds within which a client that sends a mesh must describe it."""

Pieces = AsyncIterator[scene_pb2.CreateMeshSceneRequest]
Call = Callable[[Any], Any]


def add_services(gateway: Gateway, server: grpc.aio.Server) -> None:
    """Adds all services; the messages of some streams come encoded."""
    special: dict[str, Call] = {
        "CreateScene": partial(_create_scene, gateway),
        "CreateMeshScene": partial(_create_mesh_scene, gateway),
        "ExportMotion": partial(_export_motion, gateway),
        "Control": partial(control, gateway),
    }
    for file in FILES:
        for service in file.DESCRIPTOR.services_by_name.values():
            handlers = {
                m.name: handler(
                    m, special.get(m.name) or from_message(CALLS[m.name], gateway.calls[m.name])
                )
                for m in service.methods
            }
            server.add_generic_rpc_handlers(
                [grpc.method_handlers_generic_handler(service.full_name, handlers)]
            )


# Requests that need more than one line


async def _create_scene(gateway: Gateway, request: scene_pb2.CreateSceneRequest) -> schema.Scene:
    def parsed() -> schema.NewScene:
        check_points(request)
        return parse(schema.NewScene, request)

    return await gateway.scenes.create(await asyncio.to_thread(parsed))  # large ones take long


async def _create_mesh_scene(gateway: Gateway, requests: Pieces) -> schema.Scene:
    header = await first(requests, "header", HEADER_S, "the first message must be `header`")
    check_points(header.scene, "header.scene.")
    described = await asyncio.to_thread(parse, schema.MeshScene, header, "header")
    return await gateway.scenes.create_from_mesh(described, _data(requests))


async def _export_motion(
    gateway: Gateway, request: snapshot_pb2.ExportMotionRequest
) -> AsyncGenerator[snapshot_pb2.ExportMotionResponse]:
    data = await gateway.snapshots.export_motion(
        request.session_id, parse(schema.MotionExport, request)
    )
    for part in parts_of(data):
        yield snapshot_pb2.ExportMotionResponse(file_part=part)


def check_points(request: scene_pb2.CreateSceneRequest, where: str = "") -> None:
    """Raises InvalidArgument if reading the points would take seconds.

    An empty Vector3 has two bytes.
    """
    holes = sum(len(hole.points) for floor in request.floors for hole in floor.holes)
    outlines = sum(len(floor.outline) for floor in request.floors)
    prisms = sum(len(solid.prism.outline) for solid in request.solids)
    if (points := holes + outlines + prisms) > MAX_POINTS:
        field = where + ("solids" if prisms > holes + outlines else "floors")
        raise InvalidArgument(f"outlines have {points} points; allowed: {MAX_POINTS}", field)


async def _data(requests: Pieces) -> AsyncIterator[bytes]:
    """The bytes of the later messages. Raises InvalidArgument."""
    async for request in requests:
        if request.WhichOneof("payload") != "data":
            raise InvalidArgument("after `header` comes only `data`", "data")
        yield request.data
