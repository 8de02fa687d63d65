"""The client for programs without an event loop: `Client`, run by a thread of its own."""

import asyncio
import threading
from collections.abc import (
    AsyncGenerator,
    Callable,
    Coroutine,
    Iterable,
    Iterator,
    Mapping,
    Sequence,
)
from types import TracebackType
from typing import Any, Self, TypeVar, Unpack

from wayfarer_client.behaviours import Behaviour
from wayfarer_client.bone_map import BoneMap
from wayfarer_client.client import Client
from wayfarer_client.connection import Tls
from wayfarer_client.messages import (
    Agent,
    AgentSpec,
    Batch,
    BodyFit,
    CrowdCame,
    Goal,
    GoalOptions,
    Place,
    PoseFormat,
)
from wayfarer_client.session import Session
from wayfarer_client.stream import MotionStream
from wayfarer_client.sync_scenes import SyncScene, SyncScenes
from wayfarer_client.v1 import catalog_pb2

T = TypeVar("T")


class SyncClient:
    """As `Client`; connected when created. Use it as `with`, or call `close`."""

    def __init__(
        self,
        address: str = "localhost:50051",
        timeout: float = 10.0,
        *,
        api_key: str = "",
        token: str | Callable[[], str] = "",
        tls: Tls | None = None,
        direct: bool = True,
    ) -> None:
        """As `Client`. Raises Unavailable when no server answers within `timeout` seconds."""
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name="wayfarer-client", daemon=True
        )
        self._thread.start()

        async def connected() -> Client:
            # grpc.aio binds a channel to the event loop that it is made in
            client = Client(address, timeout, api_key=api_key, token=token, tls=tls, direct=direct)
            return await client.connect()

        try:
            self._client = self._run(connected())
        except BaseException:
            self._end()
            raise

    @property
    def scenes(self) -> SyncScenes:
        """See `Client.scenes`."""
        return SyncScenes(self._client.scenes, self._run)

    def close(self) -> None:
        """Close the connection and end the thread."""
        self._run(self._client.close())
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def create_session(
        self,
        basis: str = "gltf",
        *,
        seed: int | None = None,
        lease: float | None = None,
        lock_step: bool = False,
        record: bool = False,
        scene: "SyncScene | str" = "",
        avoid: bool = True,
    ) -> "SyncSession":
        """See `Client.create_session`, as for all below."""
        session = self._client.create_session(
            basis,
            seed=seed,
            lease=lease,
            lock_step=lock_step,
            record=record,
            scene=scene if isinstance(scene, str) else scene.scene_id,
            avoid=avoid,
        )
        return SyncSession(self, self._run(session))

    def session(self, session_id: str) -> "SyncSession":
        """See `Client.session`."""
        return SyncSession(self, self._run(self._client.session(session_id)))

    def sessions(self) -> list["SyncSession"]:
        """See `Client.sessions`."""
        return [SyncSession(self, session) for session in self._run(self._client.sessions())]

    def import_session(self, snapshot: bytes) -> "SyncSession":
        """See `Client.import_session`."""
        return SyncSession(self, self._run(self._client.import_session(snapshot)))

    def generate_clip(
        self,
        agent: AgentSpec,
        goals: Iterable[Goal],
        seconds: float,
        *,
        until_arrival: bool = False,
        basis: str = "gltf",
        format: PoseFormat | None = None,
    ) -> Iterator[Batch]:
        """See `Client.generate_clip`."""
        return self._iterate(
            self._client.generate_clip(
                agent, goals, seconds, until_arrival=until_arrival, basis=basis, format=format
            )
        )

    def replay(self, log: bytes, *, format: PoseFormat | None = None) -> Iterator[Batch]:
        """See `Client.replay`."""
        return self._iterate(self._client.replay(log, format=format))

    def server_info(self) -> catalog_pb2.GetServerInfoResponse:
        """See `Client.server_info`."""
        return self._run(self._client.server_info())

    def skeleton(self) -> catalog_pb2.Skeleton:
        """See `Client.skeleton`."""
        return self._run(self._client.skeleton())

    def bodies(self) -> list[catalog_pb2.Body]:
        """See `Client.bodies`."""
        return self._run(self._client.bodies())

    def fit_body(self, character: BoneMap | Mapping[str, Sequence[float]], **how: Any) -> BodyFit:
        """See `Client.fit_body`."""
        return self._run(self._client.fit_body(character, **how))

    def models(self) -> list[catalog_pb2.Model]:
        """See `Client.models`."""
        return self._run(self._client.models())

    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def _iterate(self, batches: AsyncGenerator[Batch] | MotionStream) -> Iterator[Batch]:
        async def following() -> Batch | None:
            return await anext(batches, None)

        try:
            while (batch := self._run(following())) is not None:
                yield batch
        finally:
            self._run(batches.aclose())

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


class SyncSession:
    """As `Session`. As `with`, its lease is renewed by the client's thread."""

    def __init__(self, client: SyncClient, session: Session) -> None:
        self._client = client
        self._session = session
        self.session_id = session.session_id

    def __enter__(self) -> Self:
        self._client._run(self._session.__aenter__())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._client._run(self._session.__aexit__(kind, error, trace))

    def renew(self) -> float:
        """See `Session.renew`, as for all below."""
        return self._client._run(self._session.renew())

    def delete(self) -> None:
        """See `Session.delete`."""
        self._client._run(self._session.delete())

    def export(self) -> bytes:
        """See `Session.export`."""
        return self._client._run(self._session.export())

    def export_log(self) -> bytes:
        """See `Session.export_log`."""
        return self._client._run(self._session.export_log())

    def create_agents(self, *specs: AgentSpec) -> list[Agent]:
        """See `Session.create_agents`."""
        return self._client._run(self._session.create_agents(*specs))

    def agents(self) -> list[Agent]:
        """See `Session.agents`."""
        return self._client._run(self._session.agents())

    def agent(self, agent: Agent | str) -> Agent:
        """See `Session.agent`."""
        return self._client._run(self._session.agent(agent))

    def update_agent(
        self, agent: Agent | str, name: str | None = None, foot_lock: bool | None = None
    ) -> Agent:
        """See `Session.update_agent`."""
        return self._client._run(self._session.update_agent(agent, name, foot_lock))

    def delete_agent(self, agent: Agent | str) -> None:
        """See `Session.delete_agent`."""
        self._client._run(self._session.delete_agent(agent))

    def set_goal(
        self,
        agent: Agent | str,
        goal: Goal | Place,
        *,
        expected: int | None = None,
        **how: Unpack[GoalOptions],
    ) -> int:
        """See `Session.set_goal`."""
        return self._client._run(self._session.set_goal(agent, goal, expected=expected, **how))

    def set_path(
        self, agent: Agent | str, goals: Iterable[Goal], expected: int | None = None
    ) -> int:
        """See `Session.set_path`."""
        return self._client._run(self._session.set_path(agent, goals, expected))

    def append_goals(
        self, agent: Agent | str, goals: Iterable[Goal], expected: int | None = None
    ) -> int:
        """See `Session.append_goals`."""
        return self._client._run(self._session.append_goals(agent, goals, expected))

    def wander(
        self,
        agent: Agent | str,
        center: Place | None = None,
        radius: float | None = None,
        speed: float | None = None,
        dwell: float | None = None,
        expected: int | None = None,
    ) -> int:
        """See `Session.wander`."""
        walk = self._session.wander(agent, center, radius, speed, dwell, expected)
        return self._client._run(walk)

    def behave(self, agent: Agent | str, behaviour: Behaviour, expected: int | None = None) -> int:
        """See `Session.behave`."""
        return self._client._run(self._session.behave(agent, behaviour, expected))

    def populate(self, count: int, **how: Any) -> CrowdCame:
        """See `Session.populate`."""
        return self._client._run(self._session.populate(count, **how))

    def clear_goal(self, agent: Agent | str, expected: int | None = None) -> int:
        """See `Session.clear_goal`."""
        return self._client._run(self._session.clear_goal(agent, expected))

    def stream(
        self,
        agents: Iterable[Agent | str] = (),
        deadline: float = 30.0,
        format: PoseFormat | None = None,
        slow_reader: str = "drop_oldest",
        resume_token: str = "",
    ) -> Iterator[Batch]:
        """See `Session.stream`."""
        return self._client._iterate(
            self._session.stream(agents, deadline, format, slow_reader, resume_token)
        )

    def step(self, steps: int = 1, format: PoseFormat | None = None) -> list[Batch]:
        """See `Session.step`."""
        return self._client._run(self._session.step(steps, format))
