"""Limits of a world and of a server's scenes, checked when they are made."""

from dataclasses import dataclass, fields

from wayfarer.errors import InvalidArgument


@dataclass(frozen=True, slots=True)
class Limits:
    """Quotas of one world."""

    agents: int = 1024
    agents_per_session: int = 256
    sessions: int = 256
    goal_distance_m: float = 1000.0  # metres, horizontal, from the agent or the goal before
    path_goals: int = 256  # goals of one path

    def __post_init__(self) -> None:
        for limit in fields(self):
            if not getattr(self, limit.name) > 0:
                raise InvalidArgument(f"{limit.name} must be positive", f"limits.{limit.name}")


@dataclass(frozen=True, slots=True)
class SceneLimits:
    """Quotas of the scenes of a server."""

    scenes: int = 64
    bakes: int = 1  # at a time; they take a core each
    waiting: int = 4  # for one to end
    bake_s: float = 20.0  # seconds of a processor that a bake may take
    bake_mb: int = 1024  # megabytes of memory that it may take

    def __post_init__(self) -> None:
        for limit in fields(self):
            if not getattr(self, limit.name) > 0:
                raise InvalidArgument(f"{limit.name} must be positive", f"scenes.{limit.name}")


@dataclass(frozen=True, slots=True)
class AdmissionRules:
    """When new agents are refused."""

    most_load: float = 0.75  # share of the time for which engine or motion thread may be busy
    retry_after: float = 5.0  # seconds until a refused caller may try again
    refuse: bool = True  # False: only limits do

    def __post_init__(self) -> None:
        if not 0 < self.most_load <= 1:
            raise InvalidArgument(f"most_load is {self.most_load}; allowed: (0, 1]", "most_load")
