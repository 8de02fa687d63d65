"""A person of a file: a clip in a body, under a name."""

from dataclasses import dataclass, field

from wayfarer.body.model import BodyModel
from wayfarer.body.outfit import Look, look
from wayfarer.clips.clip import Clip
from wayfarer.clips.edit import RootTrack


@dataclass(frozen=True)
class Actor:
    """`root`: motion of a separate bone, to which `clip` is relative; none: the hips have all."""

    clip: Clip
    body: BodyModel = field(repr=False)
    name: str = "person"
    style: int = 0  # seed of its look
    outfit: str = ""  # see `look`
    root: RootTrack | None = None
    start: float = 0.0  # seconds

    @property
    def look(self) -> Look:
        """Its clothes."""
        return look(self.style, self.body.gender, self.outfit)
