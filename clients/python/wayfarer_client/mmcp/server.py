"""The protocol over HTTP: `capabilities` and `generate`."""

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


async def serve(address: str, host: str, port: int, key: str, encrypted: bool) -> None:
    """Answers at `host` and `port`, with the people of the server at `address`, until it is ended.

    Raises WayfarerError when that server cannot be reached or refuses the key.
    """
    async with Client(address, api_key=key, tls=Tls() if encrypted else None) as client:
        app = mmcp_app(await Walker.of(client))
        await uvicorn.Server(uvicorn.Config(app, host, port)).serve()
