"""Is a body still a walking person? Counts what has gone wrong over a long run."""

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.evaluation.gait import Row
from wayfarer.evaluation.tracks import Track
from wayfarer.spec import FPS

Array = NDArray[np.floating[Any]]

FALLEN_HEIGHT: Final = 0.6
"""Of the hips' height in the T-pose: lower hips have fallen."""

FALLEN_TILT: Final = 60.0
"""Degrees between the hips' up axis and the vertical: more has fallen."""

OFF_FLOOR: Final = 0.08
"""Metres of the lowest marker above (floating) or below (sunk) the floor, for half a second."""

OFF_FLOOR_FRAMES: Final = FPS // 2

EXTENT: Final = 3.0
"""Metres from the hips to a marker: more has exploded."""


@dataclass
class Health:
    """Faults of one agent, frame by frame; fed in any pieces, in order."""

    rest_height: float  # metres, hips in the T-pose
    frames: int = 0
    faults: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("nan", "exploded", "fallen", "floating", "sunk"), 0)
    )
    _above: int = 0  # frames off the floor up to now, without a break
    _below: int = 0

    def watch(self, track: Track, hips_up: Array) -> None:
        """Count the frames of `track` with a fault; hips_up [T, 3] is the hips' world up axis."""
        self.frames += len(track.hips)
        finite = np.isfinite(track.markers).all((-2, -1)) & np.isfinite(track.hips).all(-1)
        self.faults["nan"] += int((~finite).sum())
        reach = np.linalg.norm(track.markers - track.hips[:, None], axis=-1).max(-1)
        self.faults["exploded"] += int((reach > EXTENT).sum())
        low = track.hips[:, 2] < FALLEN_HEIGHT * self.rest_height
        tilted = hips_up[:, 2] < np.cos(np.radians(FALLEN_TILT))
        self.faults["fallen"] += int((low | tilted).sum())
        lowest = track.markers[..., 2].min(-1)
        self._above, floating = _long_runs(lowest > OFF_FLOOR, self._above)
        self._below, sunk = _long_runs(lowest < -OFF_FLOOR, self._below)
        self.faults["floating"] += floating
        self.faults["sunk"] += sunk


def health_row(name: str, agents: list[Health], resets: int) -> Row:
    """How many agents ever had each fault, and in what share of frames.

    `resets` are the times that the runtime put a broken agent back on its feet before any
    frame was sent: NaN and explosions that the stream does not show.
    """
    frames = sum(a.frames for a in agents)
    row: Row = {
        "name": name,
        "agents": len(agents),
        "minutes_each": frames / len(agents) / FPS / 60,
        "resets": resets,
    }
    for fault in agents[0].faults:
        row[f"{fault}_agents"] = sum(a.faults[fault] > 0 for a in agents)
        row[f"{fault}_share"] = sum(a.faults[fault] for a in agents) / frames
    return row


def _long_runs(bad: NDArray[np.bool_], before: int) -> tuple[int, int]:
    """Go on counting a run of `before` bad frames: its length now, and the frames of `bad` that
    lie in runs of half a second or more (a run's earlier frames count when it gets that long).
    """
    counted, run = 0, before
    for frame in bad.tolist():
        run = run + 1 if frame else 0
        if run == OFF_FLOOR_FRAMES:
            counted += OFF_FLOOR_FRAMES
        elif run > OFF_FLOOR_FRAMES:
            counted += 1
    return run, counted
