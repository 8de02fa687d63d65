"""Levels of detail of one stream: the tier of each agent.

Design
------
A stream may be opened with **rings** around **viewpoints**. Ring *k* has a radius and a pose
format; its agents are tier *k* of the stream. Agents outside of the last ring are not sent.
Publications do not change: when `MotionStream` sends, it asks this module for the tier of each
chunk and writes one batch per tier (`sized_batches.py`). So queues, slow readers, resume tokens and
acknowledgements work as without rings, and viewpoints may change at any time: they apply from the
next batch.

* The distance of an agent is measured from its hips in the chunk's first frame to the nearest
viewpoint, and divided by that viewpoint's reach.
* Hysteresis: an agent enters a ring at its radius and leaves it 10 % beyond.
* An agent that comes into sight is `added`, and its chunk has FIRST; an agent that goes out of
sight is `hidden`. Between tiers, the sequence numbers continue without a flag.
* A resumed stream states rings and viewpoints again; the server keeps nothing of the former stream.
Its first chunk of an agent within the rings has no FIRST, as after every resume; agents outside are
`hidden`.
* Packing is shared (`codec/encoder.py`): a chunk is packed once per basis and format, when the
first reader needs it in that tier.
* The motion thread receives how well each agent is seen (`runtime/streams/sights.py`): when time is
short, it steps agents in the innermost ring first.
* Limits: 8 rings, 8 viewpoints, finite radii. The state is one number for each agent of the
session, and is deleted with the agent.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.runtime.streams.sights import Sights
from wayfarer.transport.codec import PoseEncoding, PoseFormat
from wayfarer.world.agents.agent import MotionChunks, Sight

HYSTERESIS: Final = 0.1
"""Fraction of a ring's radius that an agent must go beyond it to leave the ring."""


@dataclass(frozen=True, slots=True)
class DetailRing:
    """The agents within a distance, and their pose format."""

    radius: float  # metres
    pose_format: PoseFormat


@dataclass(frozen=True, slots=True)
class ViewPlace:
    """A place from which agents are seen."""

    position: tuple[float, float, float]  # metres, core
    reach: float = 1.0  # factor of the radii


class DetailLevels:
    """The rings of one stream, its viewpoints, and the tier of each agent."""

    def __init__(
        self, rings: Sequence[DetailRing], viewpoints: Sequence[ViewPlace], resumed: bool = False
    ) -> None:
        self.resumed = resumed
        """Whether the reader may already show agents that are unknown here."""
        self.rings = tuple(rings)
        self._radii = np.array([ring.radius for ring in rings])
        self._tiers: dict[int, int] = {}  # by alias; len(rings): out of sight
        self.sights = Sights()
        """The tiers, in a form that the motion thread may read."""
        self._sight_of = [*map(_sight, range(len(rings)), rings), Sight.NONE]  # by tier
        self.look(viewpoints)

    def look(self, viewpoints: Sequence[ViewPlace]) -> None:
        """Sets the viewpoints from now on."""
        self._places = np.array([v.position for v in viewpoints])
        self._reach = np.array([v.reach for v in viewpoints])

    def forget(self, alias: int) -> None:
        """Forgets a deleted agent."""
        self._tiers.pop(alias, None)
        self.sights.forget(alias)

    def sort(self, chunks: MotionChunks) -> tuple[NDArray[np.intp], NDArray[np.bool_], list[int]]:
        """Sorts chunks. Returns the tier of each [A], len(rings) if it is out of sight; whether its
        agent has come into sight [A]; and the aliases of agents that have gone out of sight.
        """
        aliases, nothing = chunks.alias.tolist(), len(self.rings)
        before = np.array([self._tiers.get(alias, -1) for alias in aliases], np.intp)
        unknown = before < 0
        inner, outer = self._between(chunks.translation[:, 0])
        # after a resume, agents that may be shown already count as coming from the wider ring
        before[unknown] = outer[unknown] if self.resumed else nothing
        tiers = before.clip(outer, inner)
        found = list(zip(aliases, tiers.tolist(), strict=True))
        self._tiers.update(found)
        self.sights.see((alias, self._sight_of[tier]) for alias, tier in found)
        outside = tiers == nothing
        entered = (before == nothing) & ~outside
        left = outside & ((before < nothing) | (unknown & self.resumed))
        return tiers, entered, chunks.alias[left].tolist()

    def _between(self, places: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Maximum and minimum tiers [A] of agents at `places` [A, 3]: those of the radii, and those
        of the radii with hysteresis.
        """
        apart = np.linalg.norm(places[:, None].astype(float) - self._places, axis=-1)
        distance = (apart / self._reach).min(axis=1)
        return (
            np.searchsorted(self._radii, distance),
            np.searchsorted(self._radii * (1 + HYSTERESIS), distance),
        )


def _sight(tier: int, ring: DetailRing) -> Sight:
    if ring.pose_format.encoding is PoseEncoding.ROOT:
        return Sight.ROOT
    return Sight.FAR if tier else Sight.NEAR
