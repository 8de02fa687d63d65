"""The motion thread on a simulated machine: its own code, without threads and clock.

Time passes while the machine works (engine calls, turns of the thread) and while the thread waits.
So the aftermath of a stall, or a load of other programs, takes no real time and is reproducible.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle

from tests.world.fakes import make_world, people
from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.runtime.pipeline import DEPTH
from wayfarer.runtime.thread import MotionThread
from wayfarer.spec import STEP_SECONDS
from wayfarer.world.agents.agent import SessionSpec, Sight
from wayfarer.world.agents.goal import Goal
from wayfarer.world.stepping.budget import BudgetRules

START = 1000.0
"""Seconds: when agents are created."""

MISSED = STEP_SECONDS
"""Seconds late: a primitive that leaves later is useless."""


class Over(BaseException):
    """The simulation has come to its end."""


@dataclass
class Machine:
    """A clock that work advances; `share`: available part of the processor, by spans of time."""

    ends: float
    shares: list[tuple[float, float, float]] = field(default_factory=list)  # from, to, share
    now: float = START

    def __call__(self) -> float:
        return self.now

    def after(self, begins: float, work: float) -> float:
        """The time at which `work` seconds of a quiet machine are done."""
        time = begins
        while work > 1e-12:
            share, until = next(
                ((share, end) for start, end, share in self.shares if start <= time < end),
                (1.0, min((start for start, *_ in self.shares if start > time), default=1e12)),
            )
            if share and work <= (until - time) * share:
                return time + work / share
            work -= (until - time) * share
            time = until
        return time

    def work(self, seconds: float) -> None:
        """The motion thread works."""
        self.now = self.after(self.now, seconds)
        if self.now >= self.ends:
            raise Over


class Pipeline:
    """As `EnginePipeline`: calls one after the other, each as long as its rows take."""

    def __init__(self, machine: Machine, row: float, call: float) -> None:
        """Seconds of the engine per row, and per call."""
        self._machine, self._row, self._call = machine, row, call
        self._calls: list[tuple[object, float, float]] = []
        self._last_ended = 0.0

    is_idle = property(lambda self: not self._calls)
    has_room = property(lambda self: len(self._calls) < DEPTH)
    has_completed = property(
        lambda self: bool(self._calls) and self._calls[0][2] <= self._machine.now
    )

    @property
    def next_end(self) -> float:
        return self._calls[0][2] if self._calls else 1e12

    def age(self, now: float) -> float:
        return now - self._calls[0][1] if self._calls else 0.0

    def submit(self, schedule: Callable) -> bool:
        step = schedule(lambda call: call)
        if step is None:
            return False
        began = self._machine.now
        work = self._call + self._row * step.call.rows * step.call.candidates
        ends = self._machine.after(max(began, self._last_ended), work)
        self._last_ended = ends
        self._calls.append((step, began, ends))
        self._machine.work(1e-3)
        return True

    def completed(self) -> Iterator[tuple[object, float]]:
        while self.has_completed:
            step, began, ended = self._calls.pop(0)
            self._machine.work(1e-3)
            yield step, ended - began

    def close(self) -> None:
        pass


class Inbox:
    """Without commands: it waits."""

    def __init__(self, machine: Machine, pipeline: Pipeline) -> None:
        self._machine, self._pipeline = machine, pipeline

    def serve(self, seconds: float) -> None:
        machine = self._machine
        machine.now = max(machine.now, min(machine.now + seconds, self._pipeline.next_end))
        machine.work(1e-4)

    def wake(self) -> None:
        pass

    def open(self) -> None:
        pass

    def close(self, reason: str) -> None:
        pass


@dataclass
class Left:
    """A chunk that has left."""

    agent: str
    seq: int
    due: float
    at: float
    flags: int

    @property
    def late(self) -> float:
        return self.at - self.due


class Publisher:
    """Notes the chunks that leave, and their times."""

    def __init__(self, machine: Machine, chunk: float, seen: Mapping[str, Sight]) -> None:
        """Seconds of the thread per chunk; how well distant agents are seen."""
        self._machine, self._chunk, self._seen = machine, chunk, seen
        self.left: list[Left] = []

    def publish(self, session_id: str, chunks: object) -> None:
        self._machine.work(self._chunk * len(chunks))
        columns = (chunks.agent_id, chunks.seq, chunks.scheduled_at, chunks.flags)
        self.left += [
            Left(*row[:3], self._machine.now, row[3]) for row in zip(*columns, strict=True)
        ]

    def sights(self, session_id: str, chunks: object) -> list[Sight]:
        return [self._seen.get(agent, Sight.NEAR) for agent in chunks.agent_id]

    def waiting_sessions(self, now: float) -> list[str]:
        return []

    def flush(self) -> None:
        pass

    def tell(self, session_id: str, events: object) -> None:
        pass

    def end_all(self, error: Exception | None) -> None:
        pass


@dataclass
class Run:
    """The results of a simulation."""

    left: list[Left]
    levels: list[tuple[float, int]]  # of the ladder, when it changed
    walkers: set[str]
    seen: dict[str, Sight]

    def missed(self, since: float, until: float) -> list[tuple[str, float]]:
        """Agents and due times of primitives that were never seen, or came too late."""
        found = []
        last: dict[str, float] = {}
        for chunk in self.left:
            before = last.get(chunk.agent, chunk.due - STEP_SECONDS)
            gone = round((chunk.due - before) / STEP_SECONDS) - 1
            found += [(chunk.agent, before + STEP_SECONDS * (k + 1)) for k in range(gone)]
            if chunk.late > MISSED:
                found.append((chunk.agent, chunk.due))
            last[chunk.agent] = chunk.due
        return [(agent, due) for agent, due in found if since <= due - START < until]

    def lateness(self, since: float, until: float) -> float:
        """The greatest lateness of primitives due within these seconds."""
        return max(c.late for c in self.left if since <= c.due - START < until)


def simulated(
    seconds: float,
    shares: list[tuple[float, float, float]],
    agents: int = 48,
    load: float = 0.6,
    standing: float = 0.4,
    sights: Sequence[Sight] = (Sight.NEAR,),
    **settings: object,
) -> Run:
    """Agents on a machine whose engine is busy for the share `load` of a quiet time.

    `shares`: seconds from, to, and the available part of the machine then. Some agents stand.
    `sights`: how well they are seen, by turns.
    """
    machine = Machine(START + seconds, [(START + a, START + b, share) for a, b, share in shares])
    full = agents // 6
    sizes = tuple(range(1, 2 * full + 1))
    world = make_world(
        budget=BudgetRules(), batch_sizes=sizes, batch_multiple=full,
        batch_lookahead_s=STEP_SECONDS, **settings,
    )  # fmt: skip
    world.create_session(SessionSpec("s"), START)
    made = [agent.agent_id for agent in world.create_agents("s", people(agents), START)]
    walkers = set(made[int(standing * agents) :])
    for agent in walkers:
        world.give(agent, Goal((0.0, 400.0, 0.0)), START)
    each = load * STEP_SECONDS / agents
    most = max(search.candidates for search in world.settings.steering.searches.values())
    pipeline = Pipeline(machine, 0.8 * each / most, 0.2 * each * 2 * full)
    seen = dict(zip(made, cycle(sights), strict=False))
    publisher = Publisher(machine, 0.1 * STEP_SECONDS / agents, seen)
    thread = MotionThread(
        world=world, publisher=publisher, inbox=Inbox(machine, pipeline), pipeline=pipeline,
        warm_up=lambda: None, clock=machine, meter=MetricsSink(),
    )  # fmt: skip
    levels: list[tuple[float, int]] = []
    allow = world.load.allow

    def watched(now: float, *rest: object) -> object:
        level = allow(now, *rest)
        if not levels or levels[-1][1] != world.load.level_number:
            levels.append((now - START, world.load.level_number))
        return level

    world.load.allow = watched
    with contextlib.suppress(Over):
        thread.run()
    return Run(publisher.left, levels, walkers, seen)
