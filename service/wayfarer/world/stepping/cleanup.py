"""Foot lock of agents: from slots and chunks to `footlock.py` and back.

It works on chunks as they leave. What has been sent is never replaced, so one state per slot is
enough: replanning throws away only frames that have not come here.
"""

import numpy as np

from wayfarer.world.agents.agent import ChunkFlag, Sight
from wayfarer.world.agents.faults import check_finite
from wayfarer.world.agents.slots import Slots
from wayfarer.world.output.footlock import begin, lock_feet
from wayfarer.world.stepping.playback import Sent
from wayfarer.world.stepping.rules import ActingRules


def clean_feet(slots: Slots, sent: Sent, rules: ActingRules) -> None:
    """Lock the feet, in the chunks of `sent`, of those agents that want it.

    A pose that begins or jumps restarts its lock, and so does a lock that is switched on. Poses
    that nobody sees stay as they are: an agent that is seen as a root at most costs half as much
    beside the engine.
    """
    seen = slots.sight[sent.slots] < Sight.ROOT
    locked = slots.foot_lock[sent.slots] & seen & rules.acts("foot lock")
    if locked.any():
        # A slice, where it will do, spares copies.
        wanted = slice(None) if locked.all() else np.flatnonzero(locked)
        chunks, rows = sent.chunks, sent.slots[wanted]
        translation, rotations = chunks.translation[wanted], chunks.rotations[wanted]
        legs, feet = slots.legs.take(rows), slots.feet.take(rows)
        jumps = (chunks.flags[wanted] & ChunkFlag.FIRST) > 0
        if len(new := np.flatnonzero(jumps | ~slots.feet_begun[rows])):
            feet.put(new, begin(legs.take(new), translation[new, 0], rotations[new, 0]))
        found = lock_feet(feet, legs, translation, rotations)
        check_finite("frames with locked feet", found.rotations)
        # Nothing is written before all of it has been made, so a failure changes nothing.
        rules.tell("foot lock", rows, translation, found.rotations)
        slots.feet.put(rows, found.state)
        chunks.rotations[wanted], chunks.contacts[wanted] = found.rotations, found.contacts
    slots.feet_begun[sent.slots] = locked
