"""The client for programs without an event loop: `Client`, run by its own thread.

Each method has the name and signature of the method that it wraps.
"""

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable, Coroutine, Iterator
from functools import wraps
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

from wayfarer_client.client import Client
from wayfarer_client.connection import Tls
from wayfarer_client.messages import Batch
from wayfarer_client.scenes import Scene, Scenes
from wayfarer_client.session import Session
from wayfarer_client.stream import MotionStream
from wayfarer_client.v1 import scene_pb2

P = ParamSpec("P")
T = TypeVar("T")
S = TypeVar("S")
Run = Callable[[Coroutine[Any, Any, Any]], Any]


def run(
    method: Callable[Concatenate[Any, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[Any, P], T]:
    """The wrapped object's `method`, as a method that waits for its result."""

    @wraps(method)
    def call(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> T:
        found: T = self._run(method(self._of, *args, **kwargs))
        return found

    return call


def run_as(
    kind: Callable[[Any, Run], S], method: Callable[Concatenate[Any, P], Coroutine[Any, Any, Any]]
) -> Callable[Concatenate[Any, P], S]:
    """As `run`; the result is wrapped in a class of this module."""

    @wraps(method)
    def call(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> S:
        return kind(self._run(method(self._of, *args, **kwargs)), self._run)

    return call


def iterate(
    method: Callable[Concatenate[Any, P], AsyncGenerator[Batch] | MotionStream],
) -> Callable[Concatenate[Any, P], Iterator[Batch]]:
    """The wrapped object's `method`, as a generator of its batches."""

    @wraps(method)
    def call(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> Iterator[Batch]:
        batches = method(self._of, *args, **kwargs)

        async def following() -> Batch | None:
            return await anext(batches, None)

        try:
            while (batch := self._run(following())) is not None:
                yield batch
        finally:
            self._run(batches.aclose())

    return call


class SyncScene:
    """As `Scene`."""

    def __init__(self, scene: Scene, run: Run) -> None:
        self._of = scene
        self._run = run
        self.scene_id = scene.scene_id

    @property
    def message(self) -> scene_pb2.Scene:
        """See `Scene.message`."""
        return self._of.message

    refresh = run(Scene.refresh)
    delete = run(Scene.delete)
    put = run(Scene.put)
    remove = run(Scene.remove)
    path = run(Scene.path)
    outlines = run(Scene.outlines)
    picture = run(Scene.picture)


class SyncScenes:
    """As `Scenes`."""

    def __init__(self, scenes: Scenes, run: Run) -> None:
        self._of = scenes
        self._run = run

    create = run_as(SyncScene, Scenes.create)
    example = run_as(SyncScene, Scenes.example)
    get = run_as(SyncScene, Scenes.get)
    examples = run(Scenes.examples)

    def all(self) -> list[SyncScene]:
        """See `Scenes.all`."""
        return [SyncScene(scene, self._run) for scene in self._run(self._of.all())]


class SyncSession:
    """As `Session`. As `with`, its lease is renewed by the client's thread."""

    def __init__(self, session: Session, run: Run) -> None:
        self._of = session
        self._run = run
        self.session_id = session.session_id

    def __enter__(self) -> Self:
        self._run(self._of.__aenter__())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._run(self._of.__aexit__(kind, error, trace))

    renew = run(Session.renew)
    delete = run(Session.delete)
    export = run(Session.export)
    show = run(Session.show)
    export_log = run(Session.export_log)
    export_motion = run(Session.export_motion)
    create_agents = run(Session.create_agents)
    agents = run(Session.agents)
    agent = run(Session.agent)
    update_agent = run(Session.update_agent)
    delete_agent = run(Session.delete_agent)
    set_goal = run(Session.set_goal)
    set_path = run(Session.set_path)
    append_goals = run(Session.append_goals)
    wander = run(Session.wander)
    behave = run(Session.behave)
    clear_goal = run(Session.clear_goal)
    populate = run(Session.populate)
    stream = iterate(Session.stream)
    step = run(Session.step)


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
    ) -> None:
        """As `Client`. Raises Unavailable when no server answers within `timeout` seconds."""
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name="wayfarer-client", daemon=True
        )
        self._thread.start()

        async def connected() -> Client:
            # grpc.aio binds a channel to the event loop in which it is made
            client = Client(address, timeout, api_key=api_key, token=token, tls=tls)
            return await client.connect()

        try:
            self._of = self._run(connected())
        except BaseException:
            self._end()
            raise

    @property
    def scenes(self) -> SyncScenes:
        """See `Client.scenes`."""
        return SyncScenes(self._of.scenes, self._run)

    def close(self) -> None:
        """Closes the connection and ends the thread."""
        self._run(self._of.close())
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

    create_session = run_as(SyncSession, Client.create_session)
    session = run_as(SyncSession, Client.session)
    import_session = run_as(SyncSession, Client.import_session)

    def sessions(self) -> list[SyncSession]:
        """See `Client.sessions`."""
        return [SyncSession(session, self._run) for session in self._run(self._of.sessions())]

    generate_clip = iterate(Client.generate_clip)
    generate_file = run(Client.generate_file)
    replay = iterate(Client.replay)
    server_info = run(Client.server_info)
    skeleton = run(Client.skeleton)
    bodies = run(Client.bodies)
    fit_body = run(Client.fit_body)
    models = run(Client.models)

    def _run(self, work: Coroutine[Any, Any, T]) -> T:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def _end(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
