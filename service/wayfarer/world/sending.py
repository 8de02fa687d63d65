"""Changes of chunks as they leave: bodies on the ground, chunks by session.

A change that fails for an agent is skipped: its chunk leaves as it was planned.
"""

from collections.abc import Callable

import numpy as np

from wayfarer.world.agents.faults import Faults, Stage
from wayfarer.world.agents.registry import Registry
from wayfarer.world.agents.slots import Slots
from wayfarer.world.agents.timeline import Timeline
from wayfarer.world.observer import Observers
from wayfarer.world.rows import Index
from wayfarer.world.scenes.grounding import ground
from wayfarer.world.scenes.world_scenes import WorldScenes
from wayfarer.world.stepping.due import Due, due_by_session
from wayfarer.world.stepping.playback import Sent
from wayfarer.world.stepping.rules import PLANNED, ActingRules


class Sending:
    """Refines the chunks that leave a world, and reports them."""

    def __init__(
        self,
        *,
        slots: Slots,
        registry: Registry,
        timeline: Timeline,
        scenery: WorldScenes,
        observers: Observers,
        faults: Faults,
        rules: ActingRules,
    ) -> None:
        self._slots = slots
        self._registry = registry
        self._timeline = timeline
        self._scenery = scenery
        self._observers = observers
        self._faults = faults
        self._rules = rules

    def leave(self, leaving: list[Sent]) -> list[Due]:
        """The same chunks by session, in the order of their times."""
        found, rules = list[Due](), self._rules
        for sent in leaving:
            chunks = sent.chunks
            rules.tell(PLANNED, sent.slots, chunks.translation, chunks.rotations)
            if rules.acts("ground"):
                self._set_on_ground(sent)
                rules.tell("ground", sent.slots, chunks.translation, chunks.rotations)
            found += self._by_session(sent)
        for due in found:
            self._report(due)
        return found

    def _report(self, due: Due) -> None:
        self._observers.tell(lambda observer: observer.sent(due), due.session_id)

    def _set_on_ground(self, sent: Sent) -> None:
        if self._slots.scene[sent.slots].any():
            self._refine(Stage.GROUND, sent, lambda some: ground(self._slots, self._scenery, some))

    def _refine(self, stage: Stage, sent: Sent, refine: Callable[[Sent], None]) -> None:
        """Lets `refine` change the chunks in place, except those of agents for which it fails.

        It changes nothing when it fails.
        """
        faults = self._faults
        which = np.arange(len(sent.slots))
        if faults.any:
            which = which[~faults.out(sent.slots, stage)]
        faults.stage = stage

        def part(some: Index) -> None:
            found = sent.take(which[some])
            refine(found)
            sent.chunks.put(which[some], found.chunks)
            refined[which[some]] = True

        refined = np.zeros(len(sent.slots), np.bool_)
        try:
            if len(which) == len(sent.slots):
                refine(sent)
                return
            if len(which):
                part(np.arange(len(which)))
        except Exception as error:
            faults.split(sent.slots[which], part, error)
        if stage is Stage.GROUND:  # as high as they were
            rows = np.flatnonzero(~refined)
            floors = self._slots.footing.hips[sent.slots[rows]]
            sent.chunks.translation[rows, :, 2] += floors[:, None]

    def _by_session(self, sent: Sent) -> list[Due]:
        """Groups chunks by session. A chunk without an owner is lost, and its agent stopped."""
        slots, agents = self._slots, self._registry.by_slot
        self._faults.stage = Stage.SENDING
        try:
            return due_by_session(sent, slots, agents, self._timeline)
        except Exception as error:
            parts = self._faults.split(
                sent.slots,
                lambda some: due_by_session(sent.take(some), slots, agents, self._timeline),
                error,
            )
            told = np.concatenate([np.empty(0, np.int64), *(some for some, _ in parts)])
            lost = np.setdiff1d(np.arange(len(sent.slots)), told)
            slots.frozen[sent.slots[lost]] = True
            return [due for _, found in parts for due in found]
