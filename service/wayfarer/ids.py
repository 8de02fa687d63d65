"""Ids that say to which group they belong, so that several processes can share a service.

An id is `session-`, `scene-` or `agent-` and 24 hexadecimal digits. The first twelve are its
*group*: a scene with all its sessions and their agents, or a single session with its agents. The
owner of a group owns everything in it. Ids from before 2026-11-27 have 16 digits; those with the
same first four digits are a group.
"""

import re
import secrets
from hashlib import sha256
from typing import Final

_GROUP: Final = re.compile(r"(?:session|scene|agent)-([0-9a-f]{12}(?=[0-9a-f]{12})|[0-9a-f]{4})")

NO_ID: Final = "0000"
"""The group of text that is no id."""


def new_group() -> str:
    """A group that does not exist yet."""
    return secrets.token_hex(6)


def request_group(caller: str, request_id: str) -> str:
    """The group of all that a request with an id makes. It follows from the request, so a request
    that is sent again finds what it has made, on another node and after a restart, too.
    """
    return _digest(f"{caller}\n{request_id}")


def session_id(group: str, request: str = "") -> str:
    """A new session's id in this group, or that of the session that a request makes there."""
    return _id("session", group, request)


def scene_id(group: str, request: str = "") -> str:
    """As `session_id`, of a scene."""
    return _id("scene", group, request)


def agent_id(session_id: str) -> str:
    """A new id for an agent of the session."""
    return _id("agent", group_of(session_id))


def agent_ids(session_id: str, request: str, count: int) -> list[str]:
    """The ids of the agents that a request makes in the session."""
    group = group_of(session_id)
    return [_id("agent", group, f"{session_id}\n{request} {i}") for i in range(count)]


def group_of(name: str) -> str:
    """The group of a session, scene or agent; `NO_ID` for text that is no id."""
    found = _GROUP.match(name)
    return found[1] if found else NO_ID


def _id(kind: str, group: str, request: str = "") -> str:
    return f"{kind}-{group}{_digest(request) if request else secrets.token_hex(6)}"


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()[:12]
