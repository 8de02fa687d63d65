"""Resume tokens: how far a stream has come, as opaque text."""

import re
from dataclasses import dataclass
from typing import Final

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.agent import Resume

TOKEN: Final = re.compile(r"([A-Za-z0-9-]{1,40})\.(\d{1,18})(?:\.(\d{1,6}))?")


@dataclass(frozen=True, slots=True)
class Progress:
    """All publications before `position` were received, and of that one its chunks and `events`.

    `events` None: all of it.
    """

    epoch: str
    position: int
    events: int | None = None

    @classmethod
    def read(cls, token: str) -> "Progress | None":
        """None for an empty token. Raises InvalidArgument."""
        if not token:
            return None
        match = TOKEN.fullmatch(token)
        if match is None:
            raise InvalidArgument(
                "not a resume token; send the last one of the earlier stream, or none",
                "resume_token",
            )
        epoch, position, events = match.groups()
        return cls(epoch, int(position), None if events is None else int(events))

    def token(self) -> str:
        """The text that `read` reads."""
        rest = "" if self.events is None else f".{self.events}"
        return f"{self.epoch}.{self.position}{rest}"

    @property
    def resume(self) -> Resume:
        """Where the runtime shall go on: with this publication again, if it is not complete."""
        whole = self.events is None
        return Resume(self.epoch, self.position if whole else max(self.position - 1, 0))
