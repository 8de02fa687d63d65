"""Faults of bodies over a long run: falls, floating, sinking, spinning."""

from dataclasses import dataclass, field
from math import degrees
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.spec import FPS
from wayfarer.world.agents.heading import facing_of
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.metrics.trunk import Trunk
from wayfarer_lab.evaluation.tracks import BodyTrack

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]

FALLEN_HEIGHT: Final = 0.6
"""Share of the hips' height in the T-pose below which a body has fallen."""

FALLEN_TILT: Final = 60.0
"""Degrees between the hips' up axis and the vertical above which a body has fallen."""

TILTED: Final = 25.0
"""Degrees between the trunk and that of the T-pose (`trunk.Trunk`), for a second."""

TILTED_FRAMES: Final = FPS

OFF_FLOOR: Final = 0.08
"""Metres of the lowest marker above (floating) or below (sunk) the floor, for half a second."""

OFF_FLOOR_FRAMES: Final = FPS // 2

EXTENT: Final = 3.0
"""Metres from the hips to a marker above which a body has exploded."""

SPIN_RANGE: Final = 1.5
"""Metres, horizontal, from hips to a goal that was not reached, within which turning counts."""

SPUN: Final = 540.0
"""Degrees of net turn within that range above which an agent spins."""

FAULTS: Final = ("nan", "exploded", "fallen", "tilted", "floating", "sunk", "spinning")


@dataclass
class Streak:
    """Counts bad frames of a fault that counts only after `needed` bad frames in a row."""

    needed: int
    length: int = 0  # bad frames up to now, without a break

    def count(self, bad: Flags) -> int:
        """Add `bad` [T] and return the newly counted frames. The earlier frames of a streak count
        once it is long enough.
        """
        counted = 0
        for frame in bad.tolist():
            self.length = self.length + 1 if frame else 0
            if self.length == self.needed:
                counted += self.needed
            elif self.length > self.needed:
                counted += 1
        return counted


@dataclass
class Spin:
    """How far an agent has turned since it came near a goal that it has not reached."""

    turned: float = 0.0  # degrees, left turns positive
    heading: float | None = None  # of the previous frame; None: not near

    def count(self, headings: Array, near: Flags) -> int:
        """Add headings [T] (radians) and `near` [T]; return the number of spinning frames."""
        counted = 0
        for heading, is_near in zip(headings.tolist(), near.tolist(), strict=True):
            if not is_near:
                self.turned, self.heading = 0.0, None
                continue
            if self.heading is not None:
                self.turned += (degrees(heading - self.heading) + 180) % 360 - 180
            self.heading = heading
            counted += abs(self.turned) > SPUN
        return counted


@dataclass
class MotionHealth:
    """Faults of one agent, frame by frame; fed in any pieces, in order."""

    rest_height: float  # metres, hips in the T-pose
    trunk: Trunk
    frames: int = 0
    faults: dict[str, int] = field(default_factory=lambda: dict.fromkeys(FAULTS, 0))
    _tilted: Streak = field(default_factory=lambda: Streak(TILTED_FRAMES))
    _above: Streak = field(default_factory=lambda: Streak(OFF_FLOOR_FRAMES))
    _below: Streak = field(default_factory=lambda: Streak(OFF_FLOOR_FRAMES))
    _spin: Spin = field(default_factory=Spin)

    def watch(self, track: BodyTrack, hips: Array, near: Flags) -> None:
        """Count the frames of `track` with a fault.

        hips [T, 4] are the hips' world rotations (x, y, z, w); near [T]: within `SPIN_RANGE` of a
        goal that has not been reached.
        """
        self.frames += len(track.hips)
        finite = np.isfinite(track.markers).all((-2, -1)) & np.isfinite(track.hips).all(-1)
        reach = np.linalg.norm(track.markers - track.hips[:, None], axis=-1).max(-1)
        low = track.hips[:, 2] < FALLEN_HEIGHT * self.rest_height
        upright = 1 - 2 * (hips[:, 0] ** 2 + hips[:, 1] ** 2)  # cosine of the hips' tilt
        lying = upright < np.cos(np.radians(FALLEN_TILT))
        lowest = track.markers[..., 2].min(-1)
        x, y = np.moveaxis(facing_of(hips), -1, 0)
        for fault, frames in {
            "nan": int((~finite).sum()),
            "exploded": int((reach > EXTENT).sum()),
            "fallen": int((low | lying).sum()),
            "tilted": self._tilted.count(self.trunk.tilt(track.markers) > TILTED),
            "floating": self._above.count(lowest > OFF_FLOOR),
            "sunk": self._below.count(lowest < -OFF_FLOOR),
            "spinning": self._spin.count(np.arctan2(-x, y), near),
        }.items():
            self.faults[fault] += frames


def health_row(name: str, agents: list[MotionHealth], resets: int) -> Row:
    """Faults in minutes of goal after goal.

    `…_agents` are agents that ever had the fault, `…_share` is the share of frames with it.
    *Scripts* have the figures of the manoeuvre `reversals`.

    Figures:
        fallen_*: hips below 0.6 of their height, or 60° over
        tilted_*: trunk over 25° for 1 s
        floating_*: lowest marker more than 8 cm above the floor for 0.5 s
        sunk_*: lowest marker more than 8 cm below the floor for 0.5 s
        spinning_*: turned by 540° within 1.5 m of a goal not reached
        exploded_*: a marker more than 3 m from the hips
        nan_*: numbers that are not finite
        resets: how often an agent leaned by 32° or squatted and was put back to a stand
        at_s: when an agent got up, from its first frame on
        state: what it was doing
        lean_deg: mean lean of its spine when it fell
        hips: height of its hips then ÷ that in a stand
        minutes_each: length of the run
        goals_given: number of goals given
        goals_reached: number of goals reached
    """
    frames = sum(a.frames for a in agents)
    row: Row = {
        "name": name,
        "agents": len(agents),
        "minutes_each": frames / len(agents) / FPS / 60,
        "resets": resets,
    }
    for fault in FAULTS:
        row[f"{fault}_agents"] = sum(a.faults[fault] > 0 for a in agents)
        row[f"{fault}_share"] = sum(a.faults[fault] for a in agents) / frames
    return row
