"""Faults: errors while one agent or session is stepped, kept away from all others.

A stage of a turn works on many agents at once. When it fails, it is repeated for halves of them,
then quarters, until the agents for which it fails are found. These sit the stage out, longer each
time, and after `MAX_FAULTS` faults until they get another goal.

Faults are contained only if there is a `report`. Without it, as in tests, clips and evaluations,
every error is raised, so that nothing is hidden.
"""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, TypeVar

import numpy as np

from wayfarer.spec import FPS, NEW_FRAMES, STEP_SECONDS
from wayfarer.world.agents.registry import Registry
from wayfarer.world.agents.route import Passage
from wayfarer.world.agents.slots import Slots
from wayfarer.world.avoidance.people import Memory
from wayfarer.world.events import Event, EventKind
from wayfarer.world.rows import Flags, Float, Index

T = TypeVar("T")

MAX_FAULTS: Final = 6
"""Faults after which an agent is not retried by itself, and a session is set aside."""

PAUSE: Final = 5
"""Steps that an agent sits out after its first fault; doubled after each further one."""

CALM: Final = 300
"""Steps without a fault after which an agent's earlier faults are forgotten."""

ENGINE_CALLS: Final = 48
"""Maximum engine calls for finding the agents for which a call fails. If they do not suffice, the
turn fails.
"""

NEVER: Final = 2**62


class Stage(StrEnum):
    """A part of a turn."""

    SCENE = "scene"
    CROWD = "crowd"
    BEHAVIOUR = "behaviour"
    WAY = "way"
    STEERING = "steering"
    INPUTS = "inputs"
    ENGINE = "engine"
    RULES = "rules"
    COASTING = "coasting"
    RESTING = "resting"
    STANDING = "standing"
    GROUND = "ground"
    SENDING = "sending"
    RECORD = "record"
    SCHEDULE = "schedule"
    PUBLICATION = "publication"
    SIGHT = "sight"
    ROOTS = "roots"
    EVENT = "event"
    DELIVERY = "delivery"
    RESTORE = "restore"


DOING: Final = {
    Stage.SCENE: "while a change of the scene was taken up",
    Stage.CROWD: "while people of the crowd came or left",
    Stage.BEHAVIOUR: "in its behaviour",
    Stage.WAY: "while its way was looked for",
    Stage.STEERING: "while it was steered",
    Stage.INPUTS: "while its next step was prepared",
    Stage.ENGINE: "in the motion model",
    Stage.RULES: "while its new frames were checked",
    Stage.COASTING: "while it was moved without the motion model",
    Stage.RESTING: "while it was held in place",
    Stage.STANDING: "while it was held in place",
    Stage.GROUND: "while it was set on the ground",
    Stage.SENDING: "while its frames were sent",
    Stage.RECORD: "while its state was kept",
    Stage.SCHEDULE: "while the session's schedule was kept",
    Stage.PUBLICATION: "while the session's frames were published",
    Stage.SIGHT: "while it was found out who is seen how well",
    Stage.ROOTS: "while roots were smoothed for distant readers",
    Stage.EVENT: "while an event was reported",
    Stage.DELIVERY: "while frames were handed to a stream",
    Stage.RESTORE: "while the session was restored",
}
"""Text of an event."""

HOLDING: Final = frozenset(
    (Stage.WAY, Stage.STEERING, Stage.INPUTS, Stage.ENGINE, Stage.RULES, Stage.COASTING)
)
"""Stages without which an agent is held in place."""


LOST: Final = frozenset((Stage.STANDING, Stage.SENDING))
"""Stages without which an agent is not stepped further."""

MEANWHILE: Final = {
    **dict.fromkeys(HOLDING, "it stands where it is"),
    **dict.fromkeys(LOST, "nothing more comes from it; delete it"),
    Stage.BEHAVIOUR: "it stays with its present goal",
}
"""The state of an agent while it sits a stage out."""


class NotFiniteError(ArithmeticError):
    """Numbers became NaN or infinite, or a body was moved too far."""


def check_finite(what: str, *arrays: Float) -> None:
    """Raises NotFiniteError when a number of `arrays` is NaN or infinite."""
    with np.errstate(invalid="ignore", over="ignore"):
        # A sum is not finite unless all its terms are: one pass, and no array of flags.
        if not all(np.isfinite(values.sum()) for values in arrays):
            raise NotFiniteError(f"{what} are not finite")


@dataclass(frozen=True, slots=True)
class Fault:
    """One error, and the agent or session that it belongs to."""

    stage: Stage
    error: Exception
    session_id: str = ""
    agent_id: str = ""
    times: int = 1  # faults of this agent or session in this stage so far, including this one
    given_up: bool = False  # whether it is not retried by itself


Report = Callable[[Fault], None]


@dataclass(slots=True)
class _Trouble:
    """The faults of an agent in a stage; chunks count as `planned_chunks`."""

    times: int
    until: int  # the first chunk for which it is retried
    holds: bool  # the agent is held meanwhile


class Faults:
    """The faults of a world. Belongs to the world's thread."""

    def __init__(self, slots: Slots, registry: Registry, report: Report | None = None) -> None:
        """`report` receives every contained fault; None: errors are raised."""
        self._slots = slots
        self._registry = registry
        self._report = report
        self._troubles: dict[tuple[int, Stage], _Trouble] = {}
        self._sessions: dict[tuple[str, Stage], int] = {}
        self._events: list[tuple[str, Event]] = []
        self.now = 0.0
        """The world's time; set by the caller that lets time pass."""
        self.stage = Stage.STEERING
        """The present stage, for stages that handle all agents together."""
        self.condemned: list[str] = []
        """Sessions that fail repeatedly, which the world's owner should set aside."""

    @property
    def contained(self) -> bool:
        """Whether errors are kept away from others; otherwise they are raised."""
        return self._report is not None

    @property
    def any(self) -> bool:
        """Whether any agent may have to sit a stage out."""
        return bool(self._troubles)

    def take_events(self) -> list[tuple[str, Event]]:
        """Events for agents and sessions since the last call, by session."""
        events, self._events = self._events, []
        return events

    # Attribution

    def split(
        self, rows: Index, run: Callable[[Index], T], error: Exception, most: int = NEVER
    ) -> list[tuple[Index, T]]:
        """Runs `run` for parts of `rows`, after it has failed for all of them together.

        `run` takes positions in `rows`. Returns the parts that succeeded, with their results. The
        rows of the others have a fault. Raises `error` where faults are not contained, and when
        `most` calls do not suffice.
        """
        if self._report is None:
            raise error
        found: list[tuple[Index, T]] = []
        if not len(rows):  # it fails for nobody, too
            self._report(Fault(self.stage, error))
            return found
        waiting = [(np.arange(len(rows)), error, self.stage)]
        guilty, calls = False, 0
        while waiting:
            which, problem, stage = waiting.pop(0)
            if len(which) == 1:
                guilty = True
                self.agents(rows[which], stage, problem)
                continue
            for half in np.array_split(which, 2):
                calls += 1
                if calls > most:
                    raise error
                try:
                    found.append((half, run(half)))
                except Exception as again:
                    waiting.append((half, again, self.stage))
        if not guilty:  # it has failed once, or only together
            self._report(Fault(self.stage, error))
        return found

    def sound(self, rows: Index, run: Callable[[Index], object], error: Exception) -> Index:
        """The positions for which `run` does not fail, after it has failed for all `rows` together.

        Raises `error` where faults are not contained.
        """
        parts = [which for which, _ in self.split(rows, run, error)]
        return np.sort(np.concatenate(parts)) if parts else np.empty(0, np.int64)

    # Recording

    def agents(
        self, slots: Collection[int] | Index, stage: Stage, error: Exception, holds: bool = True
    ) -> None:
        """Records a fault of the agents in these slots. Not `holds`: they need not be held for it.

        Raises `error` if faults are not contained.
        """
        if self._report is None:
            raise error
        for slot in map(int, slots):
            trouble = self._more(slot, stage, holds and stage in HOLDING)
            self._forget_state(slot, stage)
            agent = self._registry.by_slot.get(slot)
            if agent is None:  # the slot has no agent: nothing more must be made of it
                self._slots.frozen[slot] = True
                self._report(Fault(stage, error))
                continue
            given_up = trouble.until == NEVER
            self._report(
                Fault(stage, error, agent.session_id, agent.agent_id, trouble.times, given_up)
            )
            columns = self._slots
            frame = int(columns.start_frame[slot] + NEW_FRAMES * columns.planned_chunks[slot])
            event = Event(
                EventKind.FAULT,
                frame / FPS,
                agent.agent_id,
                agent.alias,
                int(columns.goal_revision[slot]),
                int(columns.planned.gait.waypoint[slot]),
                _message(stage, trouble, int(columns.planned_chunks[slot])),
            )
            self._events.append((agent.session_id, event))

    def agent(self, agent_id: str, error: Exception, stage: Stage) -> None:
        """Records a fault for which an agent need not be held, unless the agent is gone.

        Raises `error` if faults are not contained.
        """
        if (agent := self._registry.agents.get(agent_id)) is not None or self._report is None:
            self.agents([] if agent is None else [agent.slot], stage, error, holds=False)

    def session(self, session_id: str, stage: Stage, error: Exception) -> int:
        """Records a session's fault that is no single agent's; returns their number in the stage.

        Raises `error` if faults are not contained.
        """
        if self._report is None:
            raise error
        times = self._sessions[session_id, stage] = self._sessions.get((session_id, stage), 0) + 1
        self._report(Fault(stage, error, session_id, times=times, given_up=times == MAX_FAULTS))
        if times == 1:
            text = f"an error in the server {DOING[stage]}; the session goes on"
            self._events.append((session_id, Event(EventKind.FAULT, self.now, detail=text)))
        return times

    def scene(self, number: int, error: Exception) -> None:
        """Reports a scene's fault to the sessions in it.

        Raises `error` where faults are not contained.
        """
        for session in list(self._registry.sessions.values()):
            if session.scene == number:
                self.session(session.session_id, Stage.SCENE, error)

    def sessions_of(self, agent_ids: Iterable[str]) -> set[str]:
        """The sessions of the agents that still exist."""
        agents = self._registry.agents
        return {agents[name].session_id for name in agent_ids if name in agents}

    def condemn(self, session_id: str) -> None:
        """Requests that a session is set aside because it cannot continue."""
        if session_id not in self.condemned:
            self.condemned.append(session_id)

    def elsewhere(self, session_id: str, stage: Stage, error: Exception) -> None:
        """Like `session`, from another thread, and without an event.

        Raises `error` if faults are not contained.
        """
        if self._report is None:
            raise error
        self._report(Fault(stage, error, session_id))

    def take_condemned(self) -> list[str]:
        """Sessions to be set aside by the world's owner, since the last call."""
        condemned, self.condemned = self.condemned, []
        return condemned

    def nobody(self, stage: Stage, error: Exception) -> None:
        """Records a fault of no known agent or session. Raises `error` if not contained."""
        if self._report is None:
            raise error
        self._report(Fault(stage, error))

    def stop(self, slot: int, stage: Stage, error: Exception) -> None:
        """Stops an agent that cannot even be held: nothing more is made of it."""
        self.agents([slot], stage, error)
        self._slots.frozen[slot] = True

    # Sitting out

    def out(self, rows: Index, *stages: Stage) -> Flags:
        """Slots [A] that sit out one of these stages now."""
        return self._which(rows, lambda stage, _: stage in stages)

    def held(self, rows: Index) -> Flags:
        """Slots [A] that are held in place."""
        return self._which(rows, lambda _, trouble: trouble.holds)

    def pardon(self, slot: int) -> None:
        """Retries an agent at once, since it has received another command."""
        if not self._troubles:
            return
        for (other, _), trouble in self._troubles.items():
            if other == slot:
                trouble.until = int(self._slots.planned_chunks[slot])

    def forget(self, slot: int) -> None:
        """Forgets the agent of a slot."""
        if self._troubles:
            self._troubles = {key: t for key, t in self._troubles.items() if key[0] != slot}

    def forget_session(self, session_id: str) -> None:
        """Forgets a session."""
        if self._sessions:
            self._sessions = {k: n for k, n in self._sessions.items() if k[0] != session_id}

    def succeeded(self, session_id: str, stage: Stage) -> None:
        """Notes that a stage that had failed for a session has succeeded."""
        if self._sessions:
            self._sessions.pop((session_id, stage), None)

    # Private

    def _more(self, slot: int, stage: Stage, holds: bool) -> _Trouble:
        planned = int(self._slots.planned_chunks[slot])
        before = self._troubles.get((slot, stage))
        times = 1 if before is None else before.times + 1
        until = NEVER if times >= MAX_FAULTS else planned + PAUSE * 2 ** (times - 1)
        found = self._troubles[slot, stage] = _Trouble(min(times, MAX_FAULTS), until, holds)
        return found

    def _which(self, rows: Index, concerns: Callable[[Stage, _Trouble], bool]) -> Flags:
        if not self._troubles:
            return np.zeros(len(rows), np.bool_)
        planned, over, out = self._slots.planned_chunks, list[tuple[int, Stage]](), list[int]()
        for (slot, stage), trouble in self._troubles.items():
            if trouble.until != NEVER and planned[slot] > trouble.until + CALM:
                over.append((slot, stage))
            elif planned[slot] < trouble.until and concerns(stage, trouble):
                out.append(slot)
        for key in over:
            del self._troubles[key]
        return np.isin(rows, out)

    def _forget_state(self, slot: int, stage: Stage) -> None:
        """Forgets the rules' state of the agent, since it may be the cause of the failure."""
        slots = self._slots
        if stage in HOLDING:
            slots.planned.memory.put(np.array([slot]), Memory.empty(1))
            slots.route.passage[slot] = Passage.UNKNOWN


def _message(stage: Stage, trouble: _Trouble, planned: int) -> str:
    stands = MEANWHILE.get(stage, "it goes on without")
    if stage in LOST:
        return f"an error in the server {DOING[stage]}: {stands}"
    again = " until it is given another goal"
    if trouble.until != NEVER:
        again = f" and is tried again in {(trouble.until - planned) * STEP_SECONDS:g} s"
    return f"an error in the server {DOING[stage]}: {stands}{again}"
