"""Ids that say which slot they belong to, so that several processes can share a service.

An id is `session-`, `scene-` or `agent-` and hexadecimal digits. The first four digits are its
*slot*. A session shares it with its agents, and a scene with all its sessions, on every server. The
owner of a slot owns everything in it.
"""

import re
import secrets
from typing import Final

SLOTS: Final = 1 << 16
_SLOT: Final = re.compile(r"(?:session|scene|agent)-([0-9a-f]{4})")


def any_slot() -> int:
    """A slot drawn at random."""
    return secrets.randbelow(SLOTS)


def session_id(slot: int) -> str:
    """A new session's id in this slot."""
    return _id("session", slot)


def scene_id(slot: int) -> str:
    """A new scene's id in this slot."""
    return _id("scene", slot)


def agent_id(session_id: str) -> str:
    """A new id for an agent of the session."""
    return _id("agent", slot_of(session_id))


def slot_of(name: str) -> int:
    """The slot of a session, scene or agent; 0 for text that is no id."""
    found = _SLOT.match(name)
    return int(found[1], 16) if found else 0


def _id(kind: str, slot: int) -> str:
    return f"{kind}-{slot:04x}{secrets.token_hex(6)}"
