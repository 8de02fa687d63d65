"""Every call of the API is checked at its door."""

import inspect

import pytest

from tests.transport.gateway.calls import called_by, caller, session
from wayfarer.errors import PermissionDenied
from wayfarer.transport.edge.caller import Scope

INNER = {
    # called by the server, not by callers
    ("sessions", "end_expired"),
    ("sessions", "take_over"),
    ("scenes", "end_expired"),
    ("scenes", "take_over"),
}
PARTS = ("scenes", "sessions", "agents", "goals", "motion", "snapshots", "catalogue", "admin")
CHANGES = {"create", "update", "delete", "set", "clear", "append", "wander", "import"}
CHANGES |= {"behave", "put", "remove", "populate"}


async def test_every_public_method_has_a_scope(api):
    scopes = {
        (part, name): getattr(method, "scope", None)
        for part in PARTS
        for name, method in inspect.getmembers(getattr(api, part), callable)
        if not name.startswith("_")
    }
    assert {name for name, scope in scopes.items() if scope is None} == INNER
    for (part, name), scope in scopes.items():
        if (part, name) in INNER:
            continue
        if part == "admin":
            assert scope is Scope.ADMIN, name
        elif name.split("_")[0] in CHANGES:
            assert scope is Scope.CONTROL, name


async def test_a_reader_may_not_change_and_a_controller_not_administrate(api):
    session_id = await session(api)
    with called_by(caller("ada", Scope.READ)):
        with pytest.raises(PermissionDenied, match=r"scope control; .* 'ada' are: read"):
            await api.sessions.delete(session_id)
        assert api.catalogue.info().fps == 40
    who = caller("ada", Scope.READ, Scope.CONTROL)
    with called_by(who), pytest.raises(PermissionDenied, match="scope admin"):
        await api.admin.drain()
