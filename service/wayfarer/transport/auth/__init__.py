"""Who calls: API keys, JWTs, client certificates → `Caller`. One door for both transports."""

from wayfarer.transport.auth.authenticator import Authenticator, Presented

__all__ = ["Authenticator", "Presented"]
