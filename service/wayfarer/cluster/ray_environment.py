"""Environment variables for Ray, which reads them when it is imported."""

import os
import secrets

from wayfarer.config.settings import PeerTls


def encrypt_ray(tls: PeerTls) -> None:
    """Encrypt Ray's links, the directory's too, with the nodes' files."""
    if tls.cert:
        os.environ.setdefault("RAY_USE_TLS", "1")
        os.environ.setdefault("RAY_TLS_SERVER_CERT", str(tls.cert))
        os.environ.setdefault("RAY_TLS_SERVER_KEY", str(tls.key))
        os.environ.setdefault("RAY_TLS_CA_CERT", str(tls.ca))


def guard_own_ray() -> None:
    """Makes this process's own Ray ask for a token that only it and its children know."""
    os.environ |= {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}
