"""Requests that match no route: 405 with all methods of the path, or 404."""

from collections.abc import Callable
from functools import cached_property
from http import HTTPStatus
from re import Pattern
from typing import Any

from starlette.exceptions import HTTPException
from starlette.routing import compile_path
from starlette.types import Receive, Scope, Send


class UnknownPath:
    """The last route below /v1.

    Starlette's own answer names only the methods of the path's first route, and leaves GET to the
    viewer's files.
    """

    def __init__(self, document: Callable[[], dict[str, Any]]) -> None:
        """`document` returns the OpenAPI document, once all routes are added."""
        self._document = document

    @cached_property
    def _paths(self) -> list[tuple[Pattern[str], str]]:
        """Regular expression and methods of each path."""
        return [
            (compile_path(path)[0], ", ".join(sorted(method.upper() for method in methods)))
            for path, methods in self._document()["paths"].items()
        ]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Raises HTTPException."""
        path, method = scope["path"], scope["method"]
        for expression, methods in self._paths:
            if expression.match(path):
                raise HTTPException(
                    HTTPStatus.METHOD_NOT_ALLOWED,
                    f"{method[:16]} is not allowed here; allowed are {methods}",
                    {"allow": methods},
                )
        raise HTTPException(HTTPStatus.NOT_FOUND, "there is no such path; /openapi.json lists all")
