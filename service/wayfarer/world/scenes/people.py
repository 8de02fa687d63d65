"""Agents as avoidance sees them: those of a session all at one moment."""

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
    stand: Flags  # agents that stand and have nowhere to go

    def rows(self, slots: Index) -> Index:
        """Where some of them stand in `people`."""
        return np.searchsorted(self.slots, slots)


class Gathering(NamedTuple):
    """Everybody of some sessions, one after the other."""

    people: People
    slots: Index  # ascending within a session
    own: tuple[Index, Index]  # [N] first row and last of everybody's session
    stand: Flags  # [N] as in `SessionPeople`
    places: Index  # of all slots, where they stand in `people`

    def in_company(self, slots: Index) -> Flags:
        """Which of some slots are not alone in their session."""
        first, last = self.own
        rows = self.places[slots]
        found: Flags = last[rows] - first[rows] > 1
        return found

    def session(self, slot: int) -> SessionPeople:
        """Everybody of the session of a slot."""
        row = self.places[slot]
        first, last = int(self.own[0][row]), int(self.own[1][row])
        return SessionPeople(
            self.people.part(first, last), self.slots[first:last], self.stand[first:last]
        )


def crowd_of(slots: Slots, rows: Index) -> Gathering:
    """Everybody of the sessions of `rows`, which are about to be stepped.

    Agents are planned to different moments; they are carried on to that of their session's `rows`.
    """
    sessions, which = np.unique(slots.session[rows], return_inverse=True)
    members = np.flatnonzero(slots.active & np.isin(slots.session, sessions))
    members = members[np.argsort(slots.session[members], kind="stable")]
    session = slots.session[members]
    own = np.searchsorted(session, session), np.searchsorted(session, session, "right")
    places = np.zeros(len(slots.active), np.int64)
    places[members] = np.arange(len(members))
    planned, route = slots.planned, slots.route
    seed, gait = planned.seed, planned.gait
    frames = slots.start_frame + NEW_FRAMES * slots.planned_chunks
    velocity = moving(seed.translation[members], gait.speed[members])
    moments = np.full(len(sessions), np.iinfo(np.int64).min)
    np.maximum.at(moments, which, frames[rows])
    ahead = (moments[np.searchsorted(sessions, session)] - frames[members]) / FPS
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
    stand = ~people.walks & ~velocity.any(-1)
    return Gathering(people, members, own, stand, places)
