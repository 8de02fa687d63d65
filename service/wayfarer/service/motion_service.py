"""The one door of the runtime: what every transport calls.

`Runtime` (runtime.py) implements it. All methods may be awaited from the event loop; none
blocks it. Errors are those of `wayfarer.errors`.
"""

from collections.abc import AsyncGenerator, AsyncIterator, Mapping, Sequence
from typing import Protocol

from wayfarer.engines.models import ModelInfo
from wayfarer.navigation.spec import Obstacle, Point2, Point3
from wayfarer.service.stats import LoopStats
from wayfarer.service.streams.publications import Publication, StreamOptions
from wayfarer.world.agents.agent import (
    AgentChange,
    AgentInfo,
    AgentSpec,
    Goal,
    SessionInfo,
    SessionSpec,
)
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.scenes.messages import (
    Crowd,
    CrowdState,
    Outlines,
    SceneInfo,
    SceneWish,
    Way,
)


class Subscription(Protocol):
    """A bounded queue of publications, for one reader."""

    epoch: str
    """Changes when the session's positions start again: with a restart or an import."""

    resumed: bool
    """The subscription goes on without a gap where `StreamOptions.resume` left off."""

    def __aiter__(self) -> AsyncIterator[Publication]:
        """Yield publications in order until the session ends.

        Raises ResourceExhausted when the reader is too slow and asked to be disconnected then,
        Unavailable when the loop has failed.
        """
        ...

    def ack(self, position: int, playhead: float) -> None:
        """The reader has received all up to `position` and shows the moment `playhead` (Unix s).

        From the first call on, nothing is yielded that begins later than the lead after it.
        """
        ...

    async def close(self) -> None:
        """Stop receiving. Safe to call twice."""
        ...


class SceneService(Protocol):
    """Scenes, their obstacles, ways through them, and the people who live there.

    A session is in at most one scene, named when it is created (`SessionSpec.scene`).
    """

    async def create_scene(self, wish: SceneWish) -> SceneInfo:
        """Bake it, off the motion thread; equal content is baked once.

        Raises InvalidArgument that names the field, ResourceExhausted when too many are kept or
        being baked, or when this one is too costly.
        """
        ...

    async def get_scene(self, scene_id: str) -> SceneInfo:
        """Raises NotFound."""
        ...

    async def list_scenes(self) -> list[SceneInfo]:
        """All, oldest first."""
        ...

    async def delete_scene(self, scene_id: str) -> None:
        """Raises NotFound; FailedPrecondition while sessions are in it."""
        ...

    async def put_obstacle(self, scene_id: str, name: str, obstacle: Obstacle) -> SceneInfo:
        """Let it stand there, or move there; agents whose way it blocks plan again.

        Raises NotFound, InvalidArgument, ResourceExhausted, and FailedPrecondition when no free
        ground would be left.
        """
        ...

    async def remove_obstacle(self, scene_id: str, name: str) -> SceneInfo:
        """Raises NotFound."""
        ...

    async def query_path(self, scene_id: str, start: Point2 | Point3, goal: Point2 | Point3) -> Way:
        """The way an agent would take. Raises NotFound, InvalidArgument, Unreachable."""
        ...

    async def scene_outlines(self, scene_id: str) -> Outlines:
        """To draw it. Raises NotFound."""
        ...

    async def scene_picture(self, scene_id: str) -> bytes:
        """A top view, PNG. Raises NotFound."""
        ...

    async def populate(self, session_id: str, crowd: Crowd) -> CrowdState:
        """Let people come and go from now on, in place of an earlier crowd; how many have come.

        With `count` 0 those there leave. Those for whom there is no room wait for it. Raises
        NotFound, FailedPrecondition when the session is in no scene, InvalidArgument.
        """
        ...


class MotionService(Protocol):
    """Sessions, agents, goals, streams; scenes have a part of their own."""

    @property
    def scenes(self) -> SceneService:
        """Scenes, obstacles, crowds."""
        ...

    @property
    def ready(self) -> bool:
        """Models are loaded and warm and the loop is running."""
        ...

    @property
    def alive(self) -> bool:
        """The loop has made a turn within the last second."""
        ...

    async def create_session(self, spec: SessionSpec) -> SessionInfo:
        """Open a session. Raises AlreadyExists, ResourceExhausted."""
        ...

    async def get_session(self, session_id: str) -> SessionInfo:
        """Raises NotFound."""
        ...

    async def list_sessions(self) -> list[SessionInfo]:
        """All, oldest first; after a restart those that the journal has kept."""
        ...

    async def delete_session(self, session_id: str) -> None:
        """End a session, its agents and its streams. Raises NotFound."""
        ...

    async def create_agents(self, session_id: str, specs: Sequence[AgentSpec]) -> list[AgentInfo]:
        """All or none. Raises NotFound, InvalidArgument, ResourceExhausted."""
        ...

    async def get_agent(self, agent_id: str) -> AgentInfo:
        """Raises NotFound."""
        ...

    async def list_agents(self, session_id: str) -> list[AgentInfo]:
        """Raises NotFound."""
        ...

    async def update_agent(self, agent_id: str, change: AgentChange) -> AgentInfo:
        """Raises NotFound, InvalidArgument."""
        ...

    async def delete_agent(self, agent_id: str) -> None:
        """Raises NotFound."""
        ...

    async def give(self, agent_id: str, command: GoalCommand, expected: int | None = None) -> int:
        """Give an agent a goal command; return the new goal revision.

        Raises NotFound, InvalidArgument that names the field, Aborted when the agent's revision is
        not `expected`; in a scene Unreachable when no way leads to a goal. A behaviour raises
        FailedPrecondition in a recorded session when it depends on other agents, and on a floor
        without end when it walks all over a scene.
        """
        ...

    async def subscribe(self, session_id: str, wish: StreamOptions) -> Subscription:
        """Follow a session. Raises NotFound; FailedPrecondition for a lock-step session."""
        ...

    async def step_session(self, session_id: str, steps: int) -> list[Publication]:
        """Let primitives pass in a lock-step session. Raises NotFound, FailedPrecondition."""
        ...

    async def export_session(self, session_id: str) -> bytes:
        """Its state as of the last frames sent. Raises NotFound."""
        ...

    async def import_session(
        self, snapshot: bytes, attributes: Mapping[str, str] | None = None
    ) -> SessionInfo:
        """Go on with an exported session; `attributes` go before those of the snapshot.

        Raises InvalidArgument, FailedPrecondition, AlreadyExists, ResourceExhausted.
        """
        ...

    async def export_log(self, session_id: str) -> bytes:
        """Commands of a recorded session. Raises NotFound, FailedPrecondition."""
        ...

    def replay(self, log: bytes) -> AsyncGenerator[Publication]:
        """Make a log's motion again, off the real-time path. Raises InvalidArgument, …"""
        ...

    def generate_clip(
        self, spec: AgentSpec, goals: Sequence[Goal], seconds: float, until_arrival: bool
    ) -> AsyncGenerator[Publication]:
        """Make a clip, off the real-time path. Raises InvalidArgument, ResourceExhausted."""
        ...

    async def list_models(self) -> list[ModelInfo]:
        """Those loaded, in order of loading."""
        ...

    async def load_model(self, name: str) -> None:
        """Load and warm a model beside others. Raises NotFound, AlreadyExists, ArtifactError."""
        ...

    async def use_model(self, name: str, move_agents: bool) -> int:
        """Let new agents, and present ones, be moved by it; returns how many. Raises NotFound."""
        ...

    async def unload_model(self, name: str) -> None:
        """Raises NotFound, FailedPrecondition while it is in use."""
        ...

    async def stats(self) -> LoopStats:
        """Figures for dashboards and the viewer."""
        ...
