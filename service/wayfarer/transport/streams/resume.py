"""Resume tokens: the progress of a stream as opaque text."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from hashlib import sha256
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.streams.publications import Resume

TOKEN: Final = re.compile(r"([A-Za-z0-9-]{1,40})\.(\d{1,18})(?:\.(\d{1,6}))?(?:~([0-9a-f]{16}))?")


@dataclass(frozen=True, slots=True)
class Progress:
    """All publications before `position` were received, and of that one its chunks and `events`.

    `events`: number of events; None: all.
    """

    epoch: str
    position: int
    events: int | None = None
    followed: str = ""  # mark of the agents that were followed; empty: all

    @classmethod
    def read(cls, token: str) -> "Progress | None":
        """Parses a token; None for an empty one. Raises InvalidArgument."""
        if not token:
            return None
        match = TOKEN.fullmatch(token)
        if match is None:
            raise InvalidArgument(
                "not a resume token; send the last one of the earlier stream, or none",
                "resume_token",
            )
        epoch, position, events, followed = match.groups()
        return cls(epoch, int(position), None if events is None else int(events), followed or "")

    def token(self) -> str:
        """Writes the text that `read` parses."""
        rest = "" if self.events is None else f".{self.events}"
        followed = f"~{self.followed}" if self.followed else ""
        return f"{self.epoch}.{self.position}{rest}{followed}"

    def resume(self, followed: str) -> Resume:
        """The point at which the runtime resumes: this publication again, if it is incomplete.

        `followed`: mark of the agents that are followed now.
        """
        whole = self.events is None
        position = self.position if whole else max(self.position - 1, 0)
        return Resume(self.epoch, position, same_agents=followed == self.followed)


def filter_mark(agent_ids: Iterable[str]) -> str:
    """Identifies a choice of agents; empty for all agents."""
    chosen = sorted(set(agent_ids))
    return sha256("\n".join(chosen).encode()).hexdigest()[:16] if chosen else ""
