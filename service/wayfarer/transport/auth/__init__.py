"""Authentication: API keys, JWTs, client certificates → `Caller`, for both transports."""

from wayfarer.transport.auth.authenticator import Authenticator, Credentials

__all__ = ["Authenticator", "Credentials"]
