"""Changes of chunks as they leave: bodies on the ground, chunks by session.

A change that fails for an agent is skipped: its chunk leaves as it was planned.
"""

from collections.abc import Callable
from dataclasses import dataclass

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


@dataclass(eq=False, kw_only=True)
class Sending:
    """Refines the chunks that leave a world, and reports them."""

    slots: Slots
    registry: Registry
    timeline: Timeline
    scenery: WorldScenes
    observers: Observers
    faults: Faults
    rules: ActingRules

    def leave(self, leaving: list[Sent]) -> list[Due]:
        """The same chunks by session, in the order of their times."""
        found, rules = list[Due](), self.rules
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
        self.observers.tell(lambda observer: observer.sent(due), due.session_id)

    def _set_on_ground(self, sent: Sent) -> None:
        if self.slots.scene[sent.slots].any():
            self._refine(Stage.GROUND, sent, lambda some: ground(self.slots, self.scenery, some))

    def _refine(self, stage: Stage, sent: Sent, refine: Callable[[Sent], None]) -> None:
        """Lets `refine` change the chunks in place, except those of agents for which it fails.

        It changes nothing when it fails.
        """
        faults = self.faults
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
            floors = self.slots.footing.hips[sent.slots[rows]]
            sent.chunks.translation[rows, :, 2] += floors[:, None]

    def _by_session(self, sent: Sent) -> list[Due]:
        """Groups chunks by session. A chunk without an owner is lost, and its agent stopped."""
        slots, agents = self.slots, self.registry.by_slot
        self.faults.stage = Stage.SENDING
        try:
            return due_by_session(sent, slots, agents, self.timeline)
        except Exception as error:
            parts = self.faults.split(
                sent.slots,
                lambda some: due_by_session(sent.take(some), slots, agents, self.timeline),
                error,
            )
            reported = np.concatenate([np.empty(0, np.int64), *(some for some, _ in parts)])
            lost = np.setdiff1d(np.arange(len(sent.slots)), reported)
            slots.frozen[sent.slots[lost]] = True
            return [due for _, found in parts for due in found]
