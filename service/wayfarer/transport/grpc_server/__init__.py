"""gRPC: a table of methods, the server."""

from wayfarer.transport.grpc_server.methods import add_services
from wayfarer.transport.grpc_server.server import SERVICES, GrpcServer

__all__ = ["SERVICES", "GrpcServer", "add_services"]
