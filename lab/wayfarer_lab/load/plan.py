"""What a load run does."""

from dataclasses import dataclass

from wayfarer.errors import InvalidArgument

TRANSPORTS = ("grpc", "websocket")


@dataclass(frozen=True)
class LoadPlan:
    """One run against one server."""

    sessions: int = 8
    agents: int = 8  # of each session
    seconds: float = 30.0  # measured, after the warm-up
    warm_up: float = 5.0
    transport: str = "grpc"
    goal_rate: float = 0.1  # new goals a second for each agent
    slow: int = 0  # extra streams whose reader takes one message every 5 s
    vanishing: int = 0  # extra streams, each cut off every second or so
    area: float = 15.0  # metres: radius of the disc in which a session's agents walk
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("sessions", "agents"):
            if getattr(self, name) < 1:
                raise InvalidArgument(f"{name} must be 1 or more", name)
        for name in ("slow", "vanishing", "goal_rate", "warm_up"):
            if getattr(self, name) < 0:
                raise InvalidArgument(f"{name} must be 0 or more", name)
        if self.seconds <= 0:
            raise InvalidArgument("seconds must be positive", "seconds")
        if self.transport not in TRANSPORTS:
            raise InvalidArgument(f"transport must be one of {', '.join(TRANSPORTS)}", "transport")
