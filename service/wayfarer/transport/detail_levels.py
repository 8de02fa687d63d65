"""Levels of detail of one stream: which agent comes in which tier.

Design
------
A stream may be opened with **rings** around **viewpoints**. Ring *k* has a radius and a format of
poses; the agents in it are tier *k* of the stream, those outside of the last ring are not sent.
Publications do not change: `MotionStream` asks this module for the tier of each chunk
when it sends, and writes one batch per tier (`portions.py`). So queues, slow readers, resume tokens
and acknowledgements work as without rings, and viewpoints may change at any time: they count from
the next batch on.

* The distance of an agent is that of its hips in the chunk's first frame to the nearest viewpoint,
  divided by that viewpoint's reach.
* Hysteresis: inwards at the radius, outwards 10 % beyond it.
* Entering from nothing is `added` and FIRST; leaving for nothing is `hidden`. Between tiers, the
  sequence numbers continue without a flag.
* A resumed stream states rings and viewpoints again; the server keeps nothing of the stream before.
  Its first chunk of an agent within the rings has no FIRST, as after every resume; agents outside
  are `hidden`.
* Packing is shared (`codec/tier_encoder.py`): a publication's chunk is packed once per basis and
  format, when the first reader needs it in that tier.
* The motion thread receives how well each agent is seen (`service/streams/sights.py`): when time is
  short, it steps those in the innermost ring first.
* Bounds: 8 rings, 8 viewpoints, finite radii; state per agent is one number, of agents that the
  session has. The state of a deleted agent goes with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.service.streams.sights import Sights
from wayfarer.transport.codec import PoseEncoding, PoseFormat
from wayfarer.world.agents.agent import MotionChunks, Sight

HYSTERESIS: Final = 0.1
"""Part of its radius by which an agent is beyond a ring when it leaves it."""


@dataclass(frozen=True, slots=True)
class DetailRing:
    """The agents within a distance, and how they are packed."""

    radius: float  # metres
    pose_format: PoseFormat


@dataclass(frozen=True, slots=True)
class ViewPlace:
    """A place that agents are seen from."""

    position: tuple[float, float, float]  # metres, core
    reach: float = 1.0  # factor of the radii


class DetailLevels:
    """The rings of one stream, its viewpoints, and the tier of each agent."""

    def __init__(
        self, rings: Sequence[DetailRing], viewpoints: Sequence[ViewPlace], resumed: bool = False
    ) -> None:
        self.resumed = resumed
        """The reader may show agents already, of whom nothing is known here."""
        self.rings = tuple(rings)
        self._radii = np.array([ring.radius for ring in rings])
        self._tiers: dict[int, int] = {}  # by alias; len(rings): nothing
        self.sights = Sights()
        """The tiers, as the motion thread may read them."""
        self._sight_of = [*map(_sight, range(len(rings)), rings), Sight.NONE]  # by tier
        self.look(viewpoints)

    def look(self, viewpoints: Sequence[ViewPlace]) -> None:
        """Sets the viewpoints from now on."""
        self._places = np.array([v.position for v in viewpoints])
        self._reach = np.array([v.reach for v in viewpoints])

    def forget(self, alias: int) -> None:
        """It has been deleted."""
        self._tiers.pop(alias, None)
        self.sights.forget(alias)

    def sort(self, chunks: MotionChunks) -> tuple[NDArray[np.intp], NDArray[np.bool_], list[int]]:
        """The tier of each chunk [A], len(rings) for nothing; whose agent has entered from nothing
        [A]; aliases of agents that are not sent any more.
        """
        aliases, nothing = chunks.alias.tolist(), len(self.rings)
        before = np.array([self._tiers.get(alias, -1) for alias in aliases], np.intp)
        unknown = before < 0
        inner, outer = self._between(chunks.translation[:, 0])
        # after a resume, who may be shown already counts as coming from within the wider ring
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
        """Tiers that agents at `places` [A, 3] have at most and at least [A]: those of the radii,
        and of the radii with hysteresis.
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
