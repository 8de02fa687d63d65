"""The API behind both transports: sessions, agents, goals, streams, and who may use them."""

from wayfarer.transport.gateway.gateway import Gateway

__all__ = ["Gateway"]
