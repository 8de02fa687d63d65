"""gRPC: one file per service, interceptors, the server."""

from wayfarer.transport.grpc_server.server import (
    FILES,
    SERVICES,
    GrpcServer,
    bracketed,
    gateway_interceptors,
    gateway_services,
)

__all__ = [
    "FILES",
    "SERVICES",
    "GrpcServer",
    "bracketed",
    "gateway_interceptors",
    "gateway_services",
]
