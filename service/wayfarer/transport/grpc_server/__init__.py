"""gRPC: a table of methods, interceptors, the server."""

from wayfarer.transport.grpc_server.methods import add_services
from wayfarer.transport.grpc_server.server import (
    SERVICES,
    GrpcServer,
    bracketed,
    gateway_interceptors,
)

__all__ = [
    "SERVICES",
    "GrpcServer",
    "add_services",
    "bracketed",
    "gateway_interceptors",
]
