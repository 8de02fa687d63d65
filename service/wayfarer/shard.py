"""Ids that name the process of their session, when several processes serve together.

An id is `session-`, `scene-` or `agent-` and hexadecimal digits. The first four are the key of the
session, which its agents' ids share, on every server: the key modulo the number of processes is the
one that has it. The id alone leads to the process: there is no table to keep, restore or agree on,
and sessions from other servers have their place, too.
"""

import re
import secrets
from dataclasses import dataclass
from typing import Final

KEYS: Final = 1 << 16
_KEY: Final = re.compile(r"(?:session|scene|agent)-([0-9a-f]{4})")


@dataclass(frozen=True, slots=True)
class Shard:
    """One of `count` processes that share the sessions of a server."""

    index: int = 0
    count: int = 1

    def session_id(self) -> str:
        """A new one, of a session that lives here."""
        return self._id("session")

    def scene_id(self) -> str:
        """A new one, of a scene that lives here, and so do the sessions that are in it."""
        return self._id("scene")

    def holds(self, name: str) -> bool:
        """Whether the session, scene or agent of this id lives here, if anywhere."""
        return shard_of(name, self.count) == self.index

    def _id(self, kind: str) -> str:
        key = secrets.randbelow(KEYS // self.count) * self.count + self.index
        return f"{kind}-{key:04x}{secrets.token_hex(6)}"


def agent_id(session_id: str) -> str:
    """A new one, of an agent of the session."""
    found = _KEY.match(session_id)
    return f"agent-{found[1] if found else '0000'}{secrets.token_hex(6)}"


def shard_of(name: str, count: int) -> int:
    """Index of the shard, of `count`, in which what has this id lives; 0 for what is no id."""
    found = _KEY.match(name)
    return int(found[1], 16) % count if found else 0
