"""The API behind both transports: sessions, agents, goals, streams, and their owners."""

from wayfarer.transport.gateway.gateway import Gateway

__all__ = ["Gateway"]
