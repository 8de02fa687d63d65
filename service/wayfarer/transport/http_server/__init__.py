"""HTTP: one file of routes per service, and the application that they make."""

from wayfarer.transport.http_server.app import http_app

__all__ = ["http_app"]
