"""`wayfarer probe`: is the service on this machine ready? For containers, which have no curl."""

import json
import ssl
import urllib.request
from pathlib import Path
from typing import Annotated
from urllib.error import URLError

import typer

from wayfarer.config import sources
from wayfarer.config.settings import Settings
from wayfarer.endpoint import bracketed
from wayfarer.errors import Unavailable

TIMEOUT_S = 2.0


def probe(
    file: Annotated[
        Path | None,
        typer.Option(
            "--config", help="Settings file of the server. Environment variables count, too."
        ),
    ] = None,
) -> None:
    """Check whether the server with these settings is ready: exit code 0, otherwise 2.

    Answers health checks of containers and supervisors.
    """
    # the service checks its callers, perhaps by settings of its command line
    typer.echo(status(sources.load({"insecure_no_auth": True}, file)))


def status(settings: Settings) -> str:
    """The service's own report. Raises Unavailable unless it is ready."""
    scheme = "https" if settings.tls_cert else "http"
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(settings.host, settings.host)
    url = f"{scheme}://{bracketed(host)}:{settings.http_port}/v1/health/ready"
    try:
        with urllib.request.urlopen(url, timeout=TIMEOUT_S, context=_unverified()) as answer:
            return str(json.load(answer)["status"])
    except (URLError, TimeoutError, ValueError, KeyError) as error:
        raise Unavailable(f"{url}: {error}") from None


def _unverified() -> ssl.SSLContext:
    """No check of the name: the certificate is for the public name, this is the machine itself."""
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context
