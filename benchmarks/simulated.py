"""Lateness of primitives on a simulated machine, which has no noise.

    python -m benchmarks.simulated [--agents 1120 1200 1440] [--seconds 30] [--slower 1.0]
        [--call 3.2 0.126] [--engine onnxruntime] [--stall 1.0] [--phases 2] [--depth 2] [--cores 2]
        [--json FILE] [--quick]

The motion thread, its world and its ladder are those of the service; clock, engine and processor
are not: an engine call takes CALL, and the thread's own work what is written beside (milliseconds,
and further ones per agent, as measured on a 2-core Xeon VM with AVX-512, onnxruntime, K = 1,
2026-11-27; in CALL are 31 microseconds an agent for event loop and clients). While a call is under
way the thread's work takes that time from it, shared by the cores. Agents get new goals as in
`wayfarer load`. *normal* and *replanned* are percentiles of the lateness of chunks as they leave,
in milliseconds. *missed* are skipped primitives, *rounds* and *calls* are publications and engine
calls in 0.2 s, and *level* is the mean of the ladder's. The same arguments always give the same
figures, so one order of steps can be compared with another.
"""

import argparse
import asyncio
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np

from benchmarks import bench
from benchmarks.bench import Row
from benchmarks.driven import InstantEngine
from wayfarer.body.library import SHIPPED, load_body
from wayfarer.config.limits import Limits
from wayfarer.engines import openvino_engine
from wayfarer.engines.onnx_engine import SIZES
from wayfarer.engines.openvino_engine import OpenVinoEngine
from wayfarer.engines.row_partitioner import RowPartitioner
from wayfarer.models.bundle import START_POSES
from wayfarer.runtime.pipeline import DEPTH
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.thread import MotionThread
from wayfarer.spec import GENDERS, STEP_SECONDS
from wayfarer.transport.edge.metrics import Metrics
from wayfarer.world.agents.agent import AgentSpec, ChunkFlag, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.budget import BudgetRules
from wayfarer.world.stepping.engine_call import PendingStep, at_once
from wayfarer.world.stepping.settings import AdmissionRules, WorldSettings
from wayfarer.world.world import World

CALL: Final = (3.2, 0.126)
SCHEDULE: Final = (0.8, 0.011)
APPLY: Final = (0.3, 0.011)
PUBLISH: Final = (0.5, 0.010)
GOAL: Final = (0.15, 0.0)
"""Milliseconds of a new goal: fixed, and per agent."""

SESSIONS: Final = 8
GOAL_RATE: Final = 0.1  # new goals a second for each agent, as `wayfarer load` gives them
WARM_UP: Final = 10.0
STALL_AT: Final = WARM_UP + 5.0
FAR: Final = 1500.0  # metres: nobody arrives, since the stand-in engine ignores goals
LEAST: Final = 1e-5  # seconds of a wait


class Machine:
    """Clock, processor, engine and inbox of a motion thread, in simulated time."""

    def __init__(self, asked: argparse.Namespace) -> None:
        self.now = 0.0
        self.thread_busy = self.engine_busy = 0.0
        self.calls = 0
        self._scale = 1e-3 * asked.slower
        self._depth, self._cores, self._stall = asked.depth, asked.cores, asked.stall
        self._call = asked.call
        self._under_way: deque[list[Any]] = deque()  # step, seconds, when it ends
        self._ends = WARM_UP + asked.seconds
        self.give: Callable[[], None] = lambda: None
        self.stop: Callable[[], None] = lambda: None
        self._rate = GOAL_RATE
        self.random = np.random.default_rng(1)
        self._next_goal = np.inf

    def clock(self) -> float:
        """Present time in seconds."""
        return self.now

    def begin_goals(self, agents: int) -> None:
        """Makes goals come for this many agents from now on."""
        self._rate = GOAL_RATE * agents
        self._next_goal = self.now + self.random.exponential(1 / self._rate)

    def work(self, cost: tuple[float, float], agents: int = 0) -> None:
        """Makes the motion thread work; running calls lose their share of the processor."""
        seconds = self._scale * (cost[0] + cost[1] * agents)
        self.now += seconds
        self.thread_busy += seconds
        for call in self._under_way:
            call[2] += seconds / self._cores

    # As `Inbox`

    def open(self) -> None:
        """Does nothing, since nothing waits."""

    def close(self, reason: str = "") -> None:
        """Does nothing, since there are no callers."""

    def wake(self) -> None:
        """Does nothing, since it wakes by itself."""

    def serve(self, timeout: float) -> None:
        """Lets time pass until a call ends or a goal comes, up to `timeout`."""
        until = [self.now + max(timeout, LEAST), self._next_goal]
        if self._under_way:
            until.append(self._under_way[0][2])
        before, self.now = self.now, max(self.now + LEAST, min(until))
        if self._stall and before < STALL_AT <= self.now:
            self.now += self._stall
            for call in self._under_way:
                call[2] += self._stall
        while self._next_goal <= self.now:
            self.give()
            self.work(GOAL)
            self._next_goal += self.random.exponential(1 / self._rate)
        if self.now >= self._ends:
            self.stop()

    # As `EnginePipeline`

    def age(self, now: float) -> float:
        """Returns 0, since calls never hang."""
        return 0.0

    @property
    def is_idle(self) -> bool:
        """Implements `EnginePipeline`."""
        return not self._under_way

    @property
    def has_room(self) -> bool:
        """Implements `EnginePipeline`."""
        return len(self._under_way) < self._depth

    @property
    def has_completed(self) -> bool:
        """Implements `EnginePipeline`."""
        return bool(self._under_way) and self._under_way[0][2] <= self.now

    def submit(self, schedule: Callable[..., PendingStep | None]) -> bool:
        """Implements `EnginePipeline`."""
        step = schedule(at_once)
        if step is None:
            return False
        rows = step.call.rows
        seconds = self._scale * (self._call[0] + self._call[1] * rows)
        self.work(SCHEDULE, rows)
        begins = max(self.now, self._under_way[-1][2] if self._under_way else self.now)
        self._under_way.append([step, seconds, begins + seconds])
        self.engine_busy += seconds
        self.calls += 1
        return True

    def completed(self) -> Iterator[tuple[PendingStep, float]]:
        """Implements `EnginePipeline`."""
        while self.has_completed:
            step, seconds, _ = self._under_way.popleft()
            self.work(APPLY, len(step.batch.rows))
            yield step, seconds


def people(world: World, count: int, machine: Machine) -> list[str]:
    """Makes walking people in several sessions; returns their ids."""
    ids = []
    for number in range(SESSIONS):
        session = world.create_session(SessionSpec(f"s{number}", avoid=False), 0.0).session_id
        specs = [
            AgentSpec(gender=GENDERS[k % 2], position=tuple(machine.random.uniform(-10, 10, 2)))
            for k in range(count // SESSIONS)
        ]
        ids += [agent.agent_id for agent in world.create_agents(session, specs, 0.0)]
    for agent_id in ids:
        world.give(agent_id, far(machine), 0.0)
    return ids


def far(machine: Machine) -> Goal:
    """A random goal."""
    return Goal((*machine.random.uniform(-FAR, FAR, 2).tolist(), 0.0))


def batches(engine: str, cores: int) -> tuple[tuple[int, ...], int]:
    """Sizes of an engine's batches, and the size for which a row costs least."""
    if engine == "openvino":
        return openvino_engine.batch_sizes(cores), OpenVinoEngine.full
    sizes = RowPartitioner(cores).sizes(SIZES)
    return sizes, sizes[-1]


def simulated(agents: int, asked: argparse.Namespace) -> Row:
    """A run with `agents` agents."""
    machine, meter = Machine(asked), Metrics()
    limits = Limits(
        agents=agents, agents_per_session=agents, sessions=SESSIONS, goal_distance_m=1e5
    )
    sizes, full = batches(asked.engine, asked.cores)
    settings = WorldSettings(
        limits=limits,
        steering=Steering().with_search(candidates=1),
        admission=AdmissionRules(refuse=False),
        budget=BudgetRules(),
        batch_sizes=sizes,
        batch_lookahead_s=STEP_SECONDS,
        batch_multiple=full,
        cores=asked.cores,
        phases=asked.phases,
    )
    bodies = {gender: load_body(SHIPPED, gender, "low") for gender in GENDERS}
    world = World(InstantEngine(), bodies, load_start_poses(START_POSES), settings)
    publisher = Publisher(limits, meter, world.get_agent, world.faults)
    thread: Any = MotionThread(
        world=world,
        publisher=publisher,
        inbox=machine,  # type: ignore[arg-type]
        pipeline=machine,  # type: ignore[arg-type]
        warm_up=lambda: None,
        clock=machine.clock,
        meter=meter,
    )
    late: dict[bool, list[float]] = {False: [], True: []}
    rounds = levels = before = 0
    take_due = world.take_due

    def taken(until: float) -> Any:
        nonlocal rounds, levels, before
        due = take_due(until)
        if machine.now <= WARM_UP:
            before = thread.stats().skipped_steps
        if due:
            rounds += 1
            levels += world.load.level_number
            machine.work(PUBLISH, sum(len(one.slots) for one in due))
        for one in due if machine.now > WARM_UP else ():
            lateness = np.maximum(1e3 * (machine.now - one.chunks.scheduled_at), 0)
            replanned = (one.chunks.flags & ChunkFlag.REPLANNED) > 0
            for kind in late:
                late[kind] += lateness[replanned == kind].tolist()
        return due

    setattr(world, "take_due", taken)  # noqa: B010  its time is counted, and what it takes
    ids = people(world, agents, machine)
    machine.begin_goals(len(ids))
    machine.give = lambda: world.give(
        ids[machine.random.integers(len(ids))], far(machine), machine.now
    )
    machine.stop = lambda: asyncio.run(thread.stop())
    thread.run()
    figures = thread.stats()
    return {
        "agents": len(ids),
        "missed": figures.skipped_steps - before,
        "p99_ms": percentiles(late[False] + late[True], 99)[0],
        **dict(
            zip(("normal_p99", "normal_p99.9"), percentiles(late[False], 99, 99.9), strict=True)
        ),
        **dict(
            zip(("replanned_p90", "replanned_p99"), percentiles(late[True], 90, 99), strict=True)
        ),
        "rounds": rounds / machine.now * STEP_SECONDS,
        "calls": machine.calls / machine.now * STEP_SECONDS,
        "engine_busy": machine.engine_busy / machine.now,
        "thread_busy": machine.thread_busy / machine.now,
        "level": levels / max(rounds, 1),
        "held": figures.held_steps,
    }


def percentiles(values: list[float], *shares: float) -> list[float]:
    """Percentiles of values; NaN without any."""
    return np.percentile(values, shares).tolist() if values else [float("nan")] * len(shares)


def main() -> None:
    """Simulate, and print."""
    parser = bench.parser(__doc__)
    parser.add_argument("--agents", type=int, nargs="+", default=[1120, 1200, 1440])
    parser.add_argument("--seconds", type=float, default=30.0, help=f"after {WARM_UP:g} s")
    parser.add_argument("--slower", type=float, default=1.0, help="factor of all that takes time")
    parser.add_argument(
        "--call",
        type=float,
        nargs=2,
        default=CALL,
        metavar="MS",
        help="milliseconds of an engine call, and further ones per agent: of another engine",
    )
    parser.add_argument(
        "--engine",
        choices=("onnxruntime", "openvino"),
        default="onnxruntime",
        help="whose sizes of batches; what a call takes is CALL",
    )
    parser.add_argument("--stall", type=float, default=0.0, help="seconds of a stop, after 5 s")
    parser.add_argument("--phases", type=int, default=WorldSettings().phases)
    parser.add_argument("--depth", type=int, default=DEPTH, help="engine calls under way at a time")
    parser.add_argument("--cores", type=int, default=2)
    asked: argparse.Namespace = parser.parse_args()
    if asked.quick:
        asked.agents, asked.seconds = asked.agents[:1], 5.0
    bench.finish(asked, [simulated(agents, asked) for agents in asked.agents])


if __name__ == "__main__":
    main()
