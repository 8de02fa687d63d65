"""Foot lock and posture of agents: from slots and chunks to `footlock.py`, `posture.py` and back.

It works on chunks as they leave. What has been sent is never replaced, so one state per slot is
enough: replanning throws away only frames that have not come here.
"""

from typing import Final, NamedTuple

import numpy as np

from wayfarer.world.agents.agent import ChunkFlag, Sight
from wayfarer.world.agents.faults import check_finite
from wayfarer.world.agents.slots import Gait, Mode, Slots
from wayfarer.world.agents.style import draws
from wayfarer.world.output.evenness import shorten_steps
from wayfarer.world.output.footlock import LockState, begin, lock_feet
from wayfarer.world.output.posture import DRAWN, PostureState, calmed, habits, hold, settled
from wayfarer.world.rows import Flags, Float, Index
from wayfarer.world.stepping.playback import Sent
from wayfarer.world.stepping.rules import ActingRules

HALTED: Final = 0.25
"""m/s: a person who is stopping and slower than this has nothing left of the walk."""

EVEN: Final = 0.01
"""Metres between the feet's floors up to which somebody who stands straightens both knees."""


def clean_feet(slots: Slots, sent: Sent, rules: ActingRules) -> None:
    """Lock the feet, in the chunks of `sent`, of those agents that want it.

    A pose that begins or jumps restarts its lock, and so does a lock that is switched on. Steps of
    the other agents only become as long as the way of their hips. Poses that nobody sees stay as
    they are: an agent that is seen as a root at most costs half as much beside the engine.
    """
    seen = slots.sight[sent.slots] < Sight.ROOT
    foot_locked = slots.foot_lock[sent.slots] & seen & rules.acts("foot lock")
    shortened = None
    if rules.acts("evenness"):
        shortened = _shortened(slots, sent, np.flatnonzero(seen & ~foot_locked))
    # A slice, where it will do, spares copies.
    wanted = slice(None) if foot_locked.all() else np.flatnonzero(foot_locked)
    locked = _locked(slots, sent, wanted, rules) if foot_locked.any() else None
    # Nothing is written before all of it has been made, so a failure changes nothing.
    chunks, agents = sent.chunks, sent.slots
    slots.feet_begun[agents] = foot_locked
    slots.feet.shortened[agents[~foot_locked]] = chunks.end.gait.shortened[~foot_locked]
    if shortened is not None:
        rows, rotations = shortened
        chunks.rotations[rows] = rotations
        rules.tell("evenness", agents[rows], chunks.translation[rows], rotations)
    if locked is not None:
        slots.feet.put(agents[wanted], locked.feet)
        slots.posture.put(agents[wanted], locked.posture)
        chunks.translation[wanted], chunks.rotations[wanted] = locked.translation, locked.rotations
        chunks.contacts[wanted] = locked.contacts


class _Locked(NamedTuple):
    """Chunks with their feet locked, and the states after them."""

    translation: Float
    rotations: Float
    contacts: Flags
    feet: LockState
    posture: PostureState


def _locked(slots: Slots, sent: Sent, wanted: slice | Index, rules: ActingRules) -> _Locked:
    chunks, rows = sent.chunks, sent.slots[wanted]
    translation, rotations = chunks.translation[wanted], chunks.rotations[wanted]
    legs, feet, posture = slots.legs.take(rows), slots.feet.take(rows), slots.posture.take(rows)
    gait = chunks.end.gait
    stands, turns = _stands(gait)[wanted], gait.mode[wanted] == Mode.TURNING
    floors = slots.footing.feet[rows]
    level = np.abs(floors[:, 0] - floors[:, 1]) < EVEN
    rests, upright = stands | turns, stands & level
    jumps = (chunks.flags[wanted] & ChunkFlag.FIRST) > 0
    if len(new := np.flatnonzero(jumps | ~slots.feet_begun[rows])):
        state = begin(legs.take(new), translation[new, 0], rotations[new, 0])
        state.shortened[:] = feet.shortened[new]
        feet.put(new, state)
        posture.put(new, settled(rotations[new, 0], rests[new], upright[new]))
    frames = translation.shape[1]
    rest, posture.rest = calmed(posture.rest, rests, frames)
    straight, posture.upright = calmed(posture.upright, upright, frames)
    steps = rests | (gait.mode[wanted] == Mode.STRAFING)
    waits = gait.mode[wanted] == Mode.STANDING
    shortened = gait.shortened[wanted]
    locked = lock_feet(feet, legs, translation, rotations, steps, waits, shortened, straight)
    rules.tell("foot lock", rows, locked.translation, locked.rotations)
    held = locked.rotations
    if rules.acts("posture"):
        own = habits(draws(slots.noise_seed[rows], DRAWN))
        held, posture = hold(posture, locked.rotations, own, rest)
        rules.tell("posture", rows, locked.translation, held)
    check_finite("frames with locked feet", locked.translation, held)
    return _Locked(locked.translation, held, locked.contacts, locked.state, posture)


def _shortened(slots: Slots, sent: Sent, unlocked: Index) -> tuple[Index, Float] | None:
    """Rows of `sent`, and their rotations with shorter steps; None: all are as they should be."""
    agents, chunks = sent.slots[unlocked], sent.chunks
    before, after = slots.feet.shortened[agents], chunks.end.gait.shortened[unlocked]
    some = np.flatnonzero((before != 0) | (after != 0))
    if not len(some):
        return None
    rows = unlocked[some]
    rotations = shorten_steps(
        slots.legs.take(agents[some]),
        chunks.translation[rows],
        chunks.rotations[rows],
        before[some],
        after[some],
    )
    check_finite("frames with shorter steps", rotations)
    return rows, rotations


def _stands(gait: Gait) -> Flags:
    """Those [A] who stand, or have come to it."""
    halted = (gait.mode == Mode.STOPPING) & ((gait.speed < HALTED) | gait.planted)
    found: Flags = (gait.mode == Mode.STANDING) | halted
    return found
