"""Administration; every call needs the scope `admin`."""

from typing import Final

from wayfarer_client.connection import Connection
from wayfarer_client.v1 import admin_pb2, catalog_pb2

LOAD_TIMEOUT_S: Final = 300.0
"""A model is checked, loaded and warmed before the call returns."""


class Admin:
    """Manages models and ends the server; `Client.admin` is one."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    async def load_model(self, name: str) -> catalog_pb2.Model:
        """Loads a model beside the others."""
        request = admin_pb2.LoadModelRequest(name=name)
        method = self._connection.admin.LoadModel
        reply: admin_pb2.LoadModelResponse = await self._connection.call(
            method, request, LOAD_TIMEOUT_S
        )
        return reply.model

    async def use_model(self, name: str, move_agents: bool = False) -> int:
        """Uses it for new agents, and on request for present ones; returns how many change."""
        request = admin_pb2.UseModelRequest(name=name, move_agents=move_agents)
        reply = await self._connection.call(self._connection.admin.UseModel, request)
        return int(reply.moved)

    async def unload_model(self, name: str) -> None:
        """Unloads a model that moves nobody."""
        request = admin_pb2.UnloadModelRequest(name=name)
        await self._connection.call(self._connection.admin.UnloadModel, request)

    async def drain(self) -> None:
        """Ends the server's streams and stops it."""
        await self._connection.call(self._connection.admin.Drain, admin_pb2.DrainRequest())
