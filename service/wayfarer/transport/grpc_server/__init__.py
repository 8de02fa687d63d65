"""gRPC: one file per service, interceptors, the server."""

from wayfarer.transport.grpc_server.server import SERVICES, GrpcServer, bracketed

__all__ = ["SERVICES", "GrpcServer", "bracketed"]
