"""Settings of a world, checked when they are made."""

from collections.abc import Callable
from dataclasses import dataclass, field

from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument
from wayfarer.ids import new_group
from wayfarer.spec import NEW_FRAMES
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.budget import BudgetRules
from wayfarer.world.stepping.rules import ActingRules

ANY_SIZE = tuple(range(1, 65))
"""Batch sizes of worlds in which nobody waits for a step: none is warmed up, none padded."""

PHASES = tuple(p for p in range(1, NEW_FRAMES + 1) if NEW_FRAMES % p == 0)
"""Allowed numbers of phases, such that each phase is on a frame."""


@dataclass(frozen=True, slots=True)
class AdmissionRules:
    """When new agents are refused."""

    most_load: float = 0.75  # share of the time for which engine or motion thread may be busy
    retry_after: float = 5.0  # seconds until a refused caller may try again
    refuse: bool = True  # False: only limits refuse

    def __post_init__(self) -> None:
        if not 0 < self.most_load <= 1:
            raise InvalidArgument(f"most_load is {self.most_load}; allowed: (0, 1]", "most_load")


@dataclass(frozen=True, slots=True)
class WorldSettings:
    """How a world is stepped."""

    limits: Limits = field(default_factory=Limits)
    steering: Steering = field(default_factory=Steering)
    budget: BudgetRules | None = None  # degradation when time is short; None: none
    admission: AdmissionRules = field(default_factory=AdmissionRules)  # once there are measures
    lead: int = 1  # chunks that are planned ahead of their time
    phases: int = 2  # moments of the 0.2 s over which agents' steps are spread
    replan_margin: float = 0.05  # s: a chunk that is due within this is not replanned
    batch_lookahead_s: float = 0.0  # s: agents due this soon may join a batch
    cores: int = 1  # shared by the engine, the loop and the transport
    batch_multiple: int = 1  # rows: a batch of this many, or a multiple, costs least per row
    batch_sizes: tuple[int, ...] = ANY_SIZE  # to which batches are padded; a server's are warmed
    single_threaded: bool = False  # engine calls use only the caller's thread
    path_queries_per_step: int = 4  # maximum ways through scenes computed in one step
    rules: ActingRules = field(
        default_factory=ActingRules
    )  # after the model; the laboratory switches them off
    new_group: Callable[[], str] = new_group  # of the ids of new sessions and scenes; see ids.py

    def __post_init__(self) -> None:
        if self.lead < 1:
            raise InvalidArgument(f"lead is {self.lead}; allowed: 1 or more chunks", "lead")
        if self.phases not in PHASES:
            raise InvalidArgument(f"phases is {self.phases}; allowed: {PHASES}", "phases")
        if not self.replan_margin >= 0:
            raise InvalidArgument("replan_margin must be 0 s or more", "replan_margin")
        ascending = list(self.batch_sizes) == sorted(set(self.batch_sizes))
        if not self.batch_sizes or not ascending or self.batch_sizes[0] < 1:
            raise InvalidArgument("batch_sizes must be ascending and positive", "batch_sizes")
