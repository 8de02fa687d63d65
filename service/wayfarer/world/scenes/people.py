"""Agents of a session as avoidance sees them: all at one moment."""

from typing import Final, NamedTuple

import numpy as np

from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Mode, Slots
from wayfarer.world.agents.velocity import FORESIGHT, moving
from wayfarer.world.avoidance.people import People
from wayfarer.world.rows import Flags, Index
from wayfarer.world.scenes.world_scenes import NOWHERE

RADIUS: Final = 0.22
"""Metres: of a person among others."""


class SessionPeople(NamedTuple):
    """Everybody of a session."""

    people: People
    slots: Index  # ascending
    stand: Flags  # who stands and does not want to go anywhere

    def rows(self, slots: Index) -> Index:
        """Where some of them stand in `people`."""
        return np.searchsorted(self.slots, slots)


def people_of(slots: Slots, rows: Index) -> dict[int, SessionPeople]:
    """Everybody of the sessions of `rows`, which are about to be stepped, by session.

    Agents are planned to different moments; they are carried on to that of their session's `rows`.
    """
    frames = slots.start_frame + NEW_FRAMES * slots.planned_chunks
    numbers, of = np.unique(slots.session[rows], return_inverse=True)
    moments = np.full(len(numbers), np.iinfo(np.int64).min)
    np.maximum.at(moments, of, frames[rows])
    members = np.flatnonzero(slots.active & np.isin(slots.session, numbers))
    members = members[np.argsort(slots.session[members], kind="stable")]
    planned, route = slots.planned, slots.route
    seed, gait = planned.seed, planned.gait
    hips = seed.translation[members]
    velocity = moving(hips, gait.speed[members])
    ahead = moments[np.searchsorted(numbers, slots.session[members])] - frames[members]
    ahead = np.minimum(np.maximum(ahead / FPS, -FORESIGHT), FORESIGHT)
    on_way = slots.aims.wants[members] & ~gait.arrived[members]
    opened = route.revision[members] == slots.goal_revision[members]
    opened &= route.passage[members] == Passage.OPEN
    walks = on_way & (opened | (slots.scene[members] == NOWHERE))
    walks |= gait.mode[members] == Mode.WALKING
    everybody = People(
        number=slots.alias[members],
        group=slots.group[members],
        position=(hips[:, -1, :2] + velocity * ahead[:, None]).astype(np.float32),
        height=hips[:, -1, 2].astype(np.float32),
        velocity=velocity,
        walks=walks,
        radius=np.full(len(members), RADIUS, np.float32),
        memory=slots.memory.take(members),
        aims=slots.aims.take(members),
    )
    stand = ~walks & ~velocity.any(-1)
    ends = np.searchsorted(slots.session[members], numbers, "right").tolist()
    return {
        number: SessionPeople(everybody.part(first, last), members[first:last], stand[first:last])
        for number, first, last in zip(numbers.tolist(), [0, *ends], ends, strict=False)
    }
