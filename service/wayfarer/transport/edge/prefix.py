"""The server below a path of a proxy: /wf/v1/info for /v1/info."""

import re
from collections.abc import Sequence
from ipaddress import IPv4Network, IPv6Network, ip_address
from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

PREFIX: Final = re.compile(r"(/[\w.~-]+)+")
"""A prefix of all paths; "." and ".." are not parts of it."""
MAX_LENGTH: Final = 200
"""Maximum characters of a prefix."""
HEADER: Final = "x-forwarded-prefix"

Network = IPv4Network | IPv6Network


def is_prefix(text: str) -> bool:
    """Whether the server may be mounted below this path."""
    dots = any(part in (".", "..") for part in text.split("/"))
    return len(text) <= MAX_LENGTH and PREFIX.fullmatch(text) is not None and not dots


class UnderPrefix:
    """Removes the prefix from paths if the proxy left it there, and puts it before redirects.

    The prefix is the X-Forwarded-Prefix of a trusted proxy, or otherwise `root_path`. All other
    links that the server writes are relative.
    """

    def __init__(self, app: ASGIApp, root_path: str, proxies: Sequence[Network]) -> None:
        self._app = app
        self._root_path = root_path
        self._proxies = tuple(proxies)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles one request or socket."""
        prefix = self._prefix(scope) if scope["type"] in ("http", "websocket") else ""
        if not prefix:
            await self._app(scope, receive, send)
            return
        path: str = scope["path"]
        if path == prefix and scope["type"] == "http":
            query = scope["query_string"].decode("latin-1")
            await RedirectResponse(f"{prefix}/{query and '?' + query}", 308)(scope, receive, send)
            return
        if path.startswith(f"{prefix}/"):
            raw = scope.get("raw_path") or path.encode()
            scope = {**scope, "path": path[len(prefix) :], "raw_path": raw[len(prefix) :]}

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                to = urlsplit(headers.get("location", ""))
                if to.path.startswith("/") and not to.path.startswith(f"{prefix}/"):
                    headers["location"] = prefix + to._replace(scheme="", netloc="").geturl()
            await send(message)

        await self._app(scope, receive, sent)

    def _prefix(self, scope: Scope) -> str:
        prefix = Headers(scope=scope).get(HEADER, "").rstrip("/")
        client = scope.get("client")
        if prefix and client and is_prefix(prefix):
            try:
                address = ip_address(client[0])
            except ValueError:  # the address of a Unix socket
                return self._root_path
            if any(address in network for network in self._proxies):
                return prefix
        return self._root_path
