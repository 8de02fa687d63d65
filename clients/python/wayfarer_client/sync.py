"""The client for programs without an event loop: `Client`, run by a thread of its own."""

import asyncio
import threading
from collections.abc import Coroutine, Iterable, Iterator
from types import TracebackType
from typing import Any, Self, TypeVar

from wayfarer_client.client import Client, Session
from wayfarer_client.messages import Agent, AgentSpec, Batch, Goal, Place
from wayfarer_client.v1 import catalog_pb2

T = TypeVar("T")


class SyncClient:
    """As `Client`; connected when created. Use it as `with`, or call `close`."""

    def __init__(self, address: str = "localhost:50051", timeout: float = 10.0) -> None:
        """Raises Unavailable when no server answers within `timeout` seconds."""
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name="wayfarer-client", daemon=True
        )
        self._thread.start()
        try:
            self._client = self._run(_connected(address, timeout))
        except BaseException:
            self._end()
            raise

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

    def create_session(self, basis: str = "gltf") -> "SyncSession":
        """See `Client.create_session`, as for all below."""
        return SyncSession(self, self._run(self._client.create_session(basis)))

    def session(self, session_id: str) -> "SyncSession":
        """See `Client.session`."""
        return SyncSession(self, self._run(self._client.session(session_id)))

    def server_info(self) -> catalog_pb2.GetServerInfoResponse:
        """See `Client.server_info`."""
        return self._run(self._client.server_info())

    def skeleton(self) -> catalog_pb2.Skeleton:
        """See `Client.skeleton`."""
        return self._run(self._client.skeleton())

    def bodies(self) -> list[catalog_pb2.Body]:
        """See `Client.bodies`."""
        return self._run(self._client.bodies())

    def models(self) -> list[catalog_pb2.Model]:
        """See `Client.models`."""
        return self._run(self._client.models())

    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()


class SyncSession:
    """As `Session`. As `with`, it is deleted at the end."""

    def __init__(self, client: SyncClient, session: Session) -> None:
        self._client = client
        self._session = session

    @property
    def session_id(self) -> str:
        """Unique on the server."""
        return self._session.session_id

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._client._run(self._session.__aexit__(kind, error, trace))

    def delete(self) -> None:
        """See `Session.delete`, as for all below."""
        self._client._run(self._session.delete())

    def create_agents(self, *specs: AgentSpec) -> list[Agent]:
        """See `Session.create_agents`."""
        return self._client._run(self._session.create_agents(*specs))

    def agents(self) -> list[Agent]:
        """See `Session.agents`."""
        return self._client._run(self._session.agents())

    def agent(self, agent: Agent | str) -> Agent:
        """See `Session.agent`."""
        return self._client._run(self._session.agent(agent))

    def delete_agent(self, agent: Agent | str) -> None:
        """See `Session.delete_agent`."""
        self._client._run(self._session.delete_agent(agent))

    def set_goal(
        self,
        agent: Agent | str,
        position: Place,
        radius: float | None = None,
        speed: float | None = None,
        heading: float | None = None,
        stop: bool = True,
        strafe: bool = False,
    ) -> int:
        """See `Session.set_goal`."""
        goal = self._session.set_goal(agent, position, radius, speed, heading, stop, strafe)
        return self._client._run(goal)

    def set_path(self, agent: Agent | str, goals: Iterable[Goal]) -> int:
        """See `Session.set_path`."""
        return self._client._run(self._session.set_path(agent, goals))

    def clear_goal(self, agent: Agent | str) -> int:
        """See `Session.clear_goal`."""
        return self._client._run(self._session.clear_goal(agent))

    def stream(self, agents: Iterable[Agent | str] = (), deadline: float = 30.0) -> Iterator[Batch]:
        """See `Session.stream`."""
        batches = self._session.stream(agents, deadline)
        try:
            while (batch := self._client._run(anext(batches, None))) is not None:
                yield batch
        finally:
            self._client._run(batches.aclose())


async def _connected(address: str, timeout: float) -> Client:
    # grpc.aio binds a channel to the event loop that it is made in
    return await Client(address, timeout).connect()
