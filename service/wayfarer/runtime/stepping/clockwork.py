"""The half of a world that moves as time passes: slots, scheduler, playback, ladder.

Time is always an argument: seconds, the same line for all calls (Unix time in the service, any
in offline use). The same calls give the same motion. Not thread-safe.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.runtime.agent import AgentState, MotionChunk
from wayfarer.runtime.commands import Recorder
from wayfarer.runtime.engines.engine import Engine
from wayfarer.runtime.engines.models import Models
from wayfarer.runtime.feet.cleanup import clean_feet
from wayfarer.runtime.scenes.book import Book
from wayfarer.runtime.scenes.grounding import ground
from wayfarer.runtime.scenes.guide import SceneGuide
from wayfarer.runtime.scenes.stage import Stage
from wayfarer.runtime.settings import WorldSettings
from wayfarer.runtime.stepping.admission import Admission, with_more
from wayfarer.runtime.stepping.budget import Budget, Rung
from wayfarer.runtime.stepping.playback import Playback
from wayfarer.runtime.stepping.scheduler import Flight, Launch, Scheduler, at_once
from wayfarer.runtime.stepping.timeline import Timeline
from wayfarer.runtime.world.orders import Orders
from wayfarer.runtime.world.paths import Paths
from wayfarer.runtime.world.population import Population
from wayfarer.runtime.world.registry import Registry
from wayfarer.runtime.world.reservations import Reservation, Reservations
from wayfarer.runtime.world.rows import Index
from wayfarer.runtime.world.slots import Mode, SlotTable
from wayfarer.runtime.world.views import Due, due_by_session
from wayfarer.spec import FPS


class Clockwork:
    """Agents in slots, who are stepped and whose chunks leave at their time; see `World`."""

    def __init__(
        self,
        engine: Engine | Models,
        bodies: Mapping[str, BodyModel],
        start_poses: NDArray[np.float32],
        settings: WorldSettings | None = None,
        recorder: Recorder | None = None,
        scenes: Book | None = None,
    ) -> None:
        """`bodies` by gender; `start_poses` [P, 22, 4] from `spawn.load_start_poses`.

        Worlds that share `Models` have theirs; one of a single engine needs none. `scenes` are
        those that sessions may be in; worlds may share them, too.
        """
        self.settings = settings = settings or WorldSettings()
        self.models = engine if isinstance(engine, Models) else Models(engine)
        self._recorder = recorder
        self._timeline = Timeline()
        self._registry = Registry(settings.limits, settings.shard)
        self._table = SlotTable(settings.limits.agents)
        self._playback = Playback(self._table.rows, settings.lead)
        # What is planned may be a goal ahead of what is sent for each chunk of it; who wanders has
        # one more.
        paths = Paths(self._table.rows, settings.limits.path_goals + settings.lead + 2)
        self._stage = Stage(scenes or Book(), self._table.rows, paths, self._timeline, settings)
        self._orders = Orders(
            self._table.rows,
            paths,
            self._playback,
            self._timeline,
            settings,
            self._registry,
            self._stage,
            recorder,
        )
        self._population = Population(
            bodies,
            start_poses,
            settings,
            self._registry,
            self._table,
            self._timeline,
            self._orders,
            self.models,
            self._stage.scenery,
        )
        self._scheduler = Scheduler(
            self._table,
            self._playback,
            paths,
            self.models,
            settings.steering,
            self._population.stand_again,
            settings.batch_sizes,
            self._planned,
            self._stage.guide,
            next(iter(bodies.values())).sole_markers.reshape(2, -1),
            settings.alone,
            settings.company * FPS,
            settings.full_batch,
        )
        wished = max(search.candidates for search in settings.steering.searches.values())
        self._everything = Rung(wished)
        self._budget = Budget(wished, settings.budget) if settings.budget is not None else None
        self._admission = Admission(settings)
        self._reservations = Reservations()

    @property
    def guide(self) -> SceneGuide:
        """What leads its agents through scenes."""
        return self._stage.guide

    def tick(self, now: float) -> list[MotionChunk]:
        """Step all agents that are due and return the chunks whose time has come."""
        sent = self.collect(now)
        while (event := self.next_event()) is not None and event <= now:
            self.step(now)
            sent += self.collect(now)
        return sent

    def step(self, now: float, rung: Rung | None = None) -> int:
        """One engine call for the agents most urgently due. Returns how many were stepped."""
        flight = self.begin(now, rung=rung)
        return 0 if flight is None else self.finish(flight)

    def begin(
        self, now: float, launch: Launch = at_once, rung: Rung | None = None
    ) -> Flight | None:
        """Set that call going; see `Scheduler.begin` for what may be done until `finish`.

        On the `rung` of the ladder that the budget finds, unless another is given. If it says so,
        agents who are due and have nothing to do are held before.
        """
        frame = self._timeline.frame(now)
        self._stage.refresh()
        self._orders.walk_on(frame + self.settings.company * FPS)
        rung = rung or self._rung(now, frame)
        if rung.hold_idle:
            self._scheduler.hold(frame)
        return self._scheduler.begin(frame, rung.candidates, launch)

    def finish(self, flight: Flight) -> int:
        """Plan the chunks of a call that has begun; returns how many agents it has stepped."""
        return self._scheduler.finish(flight)

    def collect(self, until: float) -> list[MotionChunk]:
        """The planned chunks that are to be shown by `until`; each session's in order of that."""
        return [chunk for due in self.send(until) for chunk in due.chunks]

    def send(self, until: float) -> list[Due]:
        """As `collect`, by session; a session comes again for an agent's next chunk."""
        slots, found = self._table.rows, list[Due]()
        for sent in self._playback.send(self._timeline.frame(until)):
            clean_feet(slots, sent)
            ground(slots, self._stage.scenery, sent)
            found += due_by_session(sent, slots, self._registry.by_slot, self._timeline)
        return found

    def next_event(self, planning: bool = True, early: float = 0.0) -> float | None:
        """When the next chunk is to be sent or, unless not asked for, planned; None without any.

        Chunks are sent so many seconds `early`.
        """
        frame = self._playback.next_event(planning, early * FPS)
        return None if frame is None else self._timeline.time(frame)

    def behind(self, now: float) -> float:
        """Seconds by which the next chunk to be sent is overdue; 0 when none is."""
        frame = self._playback.next_send()
        return 0.0 if frame is None else max(now - self._timeline.time(frame), 0.0)

    def advance(self, until: float) -> Iterator[MotionChunk]:
        """Run from event to event, without waiting, as far as `until`."""
        while (event := self.next_event()) is not None and event <= until:
            yield from self.tick(event)

    def rebase(self, seconds: float) -> None:
        """Move everything not yet sent to `seconds` later, when the clock has run away."""
        self._timeline.move(seconds)

    # Load

    def measured(self, agents: int, candidates: int, seconds: float) -> None:
        """An engine call of this size took so long in the warm-up: agents are admitted by it."""
        self._admission.measured(agents, candidates, seconds)

    def spent(self, now: float, flight: Flight, seconds: float) -> None:
        """Tell ladder and admission that an engine call has ended, and how long it took."""
        agents, stepped = self._population.phases.by_gender, len(flight.batch.rows)
        self._admission.spent(now, flight.call, stepped, seconds, agents)
        if self._budget is not None:
            self._budget.spent(now, seconds)

    def worked(self, now: float, seconds: float, chunks: int) -> None:
        """Tell admission what a turn took that published `chunks`, wait and step aside."""
        self._admission.worked(now, seconds, chunks)

    def load(self, now: float) -> float:
        """Share of the last seconds for which the engine, or if busier the thread, was busy."""
        return self._admission.load(now)

    def capacity(self, now: float) -> int:
        """So many agents fit into the time there is, those here included; 0: not known yet."""
        return self._admission.capacity(now)

    @property
    def rung(self) -> Rung:
        """Where the world stands on the ladder of budget.py."""
        return self._everything if self._budget is None else self._budget.rung

    @property
    def rung_number(self) -> int:
        """The same, counted from the top: 0 is where all is as wished."""
        return 0 if self._budget is None else self._budget.number

    def room_for(self, session_id: str, genders: Sequence[str], now: float) -> None:
        """Raises NotFound, ResourceExhausted when so many more could not be stepped in time."""
        self._check_room(Reservation.of(session_id, genders), now, self._reservations.all())

    @property
    def agents(self) -> int:
        """Agents of all sessions."""
        return len(self._registry.agents)

    @property
    def sessions(self) -> int:
        """Open sessions."""
        return len(self._registry.sessions)

    def states(self) -> dict[AgentState, int]:
        """How many agents are in each state, as of what has been sent."""
        slots = self._table.rows
        counts = np.bincount(slots.committed.gait.mode[slots.active], minlength=len(Mode))
        states = dict.fromkeys(AgentState, 0)
        for mode in Mode:
            states[mode.state] += int(counts[mode])
        return states

    @property
    def resets(self) -> int:
        """How often an agent had to be put back to a stand because its step was broken."""
        return self._scheduler.resets

    @property
    def reduced_steps(self) -> int:
        """Agent steps for which time was too short to try all the candidates wished for."""
        return self._scheduler.reduced_steps

    @property
    def held_steps(self) -> int:
        """Agent steps that were left out because time was short and there was nothing to do."""
        return self._scheduler.held_steps

    @property
    def refused_agents(self) -> int:
        """Agents that were not created for want of time."""
        return self._admission.refused

    # Within

    def _check_room(
        self,
        wanted: Reservation,
        now: float,
        held: Sequence[Reservation],
        admit: bool = True,
    ) -> None:
        """Whether they fit beside those who are there and those for whom room is held.

        Thread-safe. Raises NotFound, ResourceExhausted.
        """
        self._registry.check_room(wanted, held)
        if admit and self.settings.admission.refuse:
            # the ladder is looked at with each step: without agents it stands where it was left
            late = self.rung.refuse and self.agents > 0
            coming = [gender for other in held for gender in other.genders]
            agents = with_more(self._population.phases.by_gender, coming)
            self._admission.check(agents, wanted.genders, now, late)

    def _rung(self, now: float, frame: float) -> Rung:
        if self._budget is None:
            return self._everything
        slack = self._playback.slack(frame) / FPS
        return self._budget.allow(now, slack, self._scheduler.held_share, self._scheduler.under_way)

    def _planned(self, slots: Index, seqs: Index, candidates: int) -> None:
        """Tell the recorder of new chunks; 0 candidates: they are held."""
        if self._recorder is None:
            return
        rows = self._table.rows
        stamps = {n: self.models.numbered(n).stamp for n in set(rows.model[slots].tolist())}
        for agent_id, seq, model in zip(
            rows.agent_id[slots], seqs.tolist(), rows.model[slots].tolist(), strict=True
        ):
            self._recorder.planned(agent_id, seq, candidates, stamps[model])
