"""The gRPC server: health, reflection, and the services that are added to it."""

from collections.abc import Callable, Sequence
from typing import Final

import grpc
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from wayfarer.config.limits import Limits
from wayfarer.endpoint import bracketed
from wayfarer.errors import Unavailable
from wayfarer.transport.contract import FILES
from wayfarer.transport.edge.grpc_guard import OpenStreamsInterceptor

SERVICES: Final = tuple(
    service.full_name for file in FILES for service in file.DESCRIPTOR.services_by_name.values()
)

CALLS: Final = 256
"""Maximum number of concurrent calls, in addition to the streams."""


class GrpcServer:
    """The server with its health service. Create it inside a running event loop."""

    def __init__(
        self,
        add: Callable[[grpc.aio.Server], None],
        limits: Limits,
        host: str,
        port: int,
        credentials: grpc.ServerCredentials | None = None,
        interceptors: Sequence[grpc.aio.ServerInterceptor] = (),
        connections: int = 1024,
    ) -> None:
        """Binds the port. `add` adds the services. Connections beyond `connections` are closed at
        once.

        Raises Unavailable if the port cannot be bound.
        """
        size = limits.message_bytes
        self._server = server = grpc.aio.server(
            interceptors=[OpenStreamsInterceptor(), *interceptors],
            maximum_concurrent_rpcs=CALLS + limits.streams,
            options=[
                ("grpc.max_allowed_incoming_connections", connections),
                ("grpc.max_concurrent_streams", CALLS),  # of one connection
                ("grpc.max_connection_idle_ms", 600_000),
                # clients reconnect now and then, which balances the load; their streams resume
                ("grpc.max_connection_age_ms", 3_600_000),
                ("grpc.server_handshake_timeout_ms", 10_000),
                ("grpc.so_reuseport", 0),  # otherwise two servers would silently share a port
                ("grpc.max_receive_message_length", size),
                ("grpc.max_metadata_size", 16 * 1024),
                # finds clients that vanished without closing
                ("grpc.keepalive_time_ms", 20_000),
                ("grpc.keepalive_timeout_ms", 10_000),
                ("grpc.http2.min_recv_ping_interval_without_data_ms", 10_000),
                ("grpc.keepalive_permit_without_calls", 1),
            ],
        )
        add(server)
        self._health = health.aio.HealthServicer()  # type: ignore[attr-defined]
        health_pb2_grpc.add_HealthServicer_to_server(self._health, server)
        names = (*SERVICES, health.SERVICE_NAME, reflection.SERVICE_NAME)
        reflection.enable_server_reflection(names, server)
        address = f"{bracketed(host)}:{port}"
        try:
            self.port = (
                server.add_secure_port(address, credentials)
                if credentials
                else server.add_insecure_port(address)
            )
        except RuntimeError as error:
            raise Unavailable(f"cannot listen for gRPC on {address}: {error}") from None

    async def start(self) -> None:
        """Accepts calls; health is NOT_SERVING until it is set."""
        await self.set_serving(False)
        await self._server.start()

    async def set_serving(self, serving: bool) -> None:
        """Sets the status that grpc.health.v1 reports for the server and each service."""
        status = health_pb2.HealthCheckResponse
        for name in ("", *SERVICES):
            await self._health.set(name, status.SERVING if serving else status.NOT_SERVING)

    async def enter_shutdown(self) -> None:
        """Reports NOT_SERVING from now on."""
        await self._health.enter_graceful_shutdown()

    async def stop(self, grace: float) -> None:
        """Waits up to `grace` seconds for calls to end, then stops."""
        await self._server.stop(grace)
