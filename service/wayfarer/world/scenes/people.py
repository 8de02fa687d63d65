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

    def rows(self, slots: Index) -> Index:
        """Where some of them stand in `people`."""
        return np.searchsorted(self.slots, slots)

    @property
    def stand(self) -> Flags:
        """Who stands and does not want to go anywhere [N]."""
        found: Flags = ~self.people.walks & ~self.people.velocity.any(-1)
        return found


def people_of(slots: Slots, session: int, rows: Index) -> SessionPeople:
    """Everybody of a session when `rows` of it are about to be stepped.

    Agents are planned to different moments; they are carried on to that of `rows`.
    """
    members = np.flatnonzero(slots.active & (slots.session == session))
    planned, route = slots.planned, slots.route
    seed, gait = planned.seed, planned.gait
    frames = slots.start_frame + NEW_FRAMES * slots.planned_chunks
    velocity = moving(seed.translation[members], gait.speed[members])
    ahead = (frames[rows].max() - frames[members]) / FPS
    ahead = np.minimum(np.maximum(ahead, -FORESIGHT), FORESIGHT)
    mode = gait.mode[members]
    on_way = slots.aims.wants[members] & ~gait.arrived[members]
    opened = route.revision[members] == slots.goal_revision[members]
    opened &= route.passage[members] == Passage.OPEN
    walks = on_way & (opened | (slots.scene[members] == NOWHERE))
    people = People(
        number=slots.alias[members],
        group=slots.group[members],
        position=(seed.translation[members, -1, :2] + velocity * ahead[:, None]).astype(np.float32),
        height=seed.translation[members, -1, 2].astype(np.float32),
        velocity=velocity,
        walks=walks | (mode == Mode.WALKING),
        radius=np.full(len(members), RADIUS, np.float32),
        memory=slots.memory.take(members),
        aims=slots.aims.take(members),
    )
    return SessionPeople(people, members)
