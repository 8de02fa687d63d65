"""The people of a server as a model of MMCP.

python -m wayfarer_client.mmcp [address] [--host 127.0.0.1] [--port 8000] [--tls]
"""

import argparse
import asyncio
import contextlib
import os

import uvicorn
from fastapi import FastAPI
from motionmcp.server import build_app
from starlette.routing import Route

from wayfarer_client.client import Client
from wayfarer_client.connection import Tls
from wayfarer_client.mmcp.walker import Walker


def mmcp_app(walker: Walker) -> FastAPI:
    """The protocol's two paths, without the SDK's page of documentation, whose script is loaded
    from another host.
    """
    app = build_app(walker, title="Wayfarer over MMCP")
    kept = ("/capabilities", "/generate")
    app.router.routes = [
        route for route in app.router.routes if isinstance(route, Route) and route.path in kept
    ]
    return app


async def main() -> None:
    """Answer until Ctrl-C."""
    parser = argparse.ArgumentParser(
        "wayfarer_client.mmcp",
        description="The people of a server as a model of MMCP. An API key for the server is taken "
        "from WAYFARER_API_KEY. Whoever reaches this port uses it.",
    )
    parser.add_argument("address", nargs="?", default="localhost:50051", help="of the server: gRPC")
    parser.add_argument("--host", default="127.0.0.1", help="where it listens; 0.0.0.0: everywhere")
    parser.add_argument("--port", type=int, default=8000, help="where it listens; 0: any free one")
    parser.add_argument("--tls", action="store_true", help="call the server over TLS")
    asked = parser.parse_args()
    key, tls = os.environ.get("WAYFARER_API_KEY", ""), Tls() if asked.tls else None
    async with Client(asked.address, api_key=key, tls=tls) as client:
        app = mmcp_app(await Walker.of(client))
        await uvicorn.Server(uvicorn.Config(app, asked.host, asked.port)).serve()


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(main())
