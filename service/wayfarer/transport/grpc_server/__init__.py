"""gRPC: a table of methods, interceptors, the server."""

from wayfarer.transport.grpc_server.methods import FILES, add_services
from wayfarer.transport.grpc_server.server import (
    SERVICES,
    GrpcServer,
    bracketed,
    gateway_interceptors,
)

__all__ = [
    "FILES",
    "SERVICES",
    "GrpcServer",
    "add_services",
    "bracketed",
    "gateway_interceptors",
]
