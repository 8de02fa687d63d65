"""Goals and motion over one connection, with acknowledgements."""

import asyncio
import contextlib
from collections.abc import AsyncGenerator
from dataclasses import replace
from types import TracebackType
from typing import Any, Final, Self

from google.protobuf.message import Message

from wayfarer_client.connection import Backoff, Connection, goes_on
from wayfarer_client.errors import (
    FailedPrecondition,
    Misdirected,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
    from_problem,
)
from wayfarer_client.goals import GoalCommands
from wayfarer_client.homes import Route
from wayfarer_client.messages import Batch, Event, StreamInfo, Viewpoint
from wayfarer_client.stream import heard, read, refuses
from wayfarer_client.v1 import control_pb2, motion_pb2
from wayfarer_client.wire import BatchReader

VIEW_INTERVAL_S: Final = 0.1
"""Least seconds between two viewpoints that are sent."""

VIEW_ID: Final = (1 << 64) - 1
"""`command_id` of viewpoints, which are answered only when they are refused."""

QUEUE: Final = 64
"""Most batches that wait for this program; beyond it the oldest are lost."""


FIELDS: Final = {
    field.message_type.full_name: field.name  # type: ignore[union-attr]
    for field in control_pb2.ControlRequest.DESCRIPTOR.oneofs_by_name["payload"].fields
}
"""Field of a ControlRequest that each message goes into."""


class Control(GoalCommands):
    """Goals and motion over one connection. Use it as `async with`; iterate over its batches and
    give commands at the same time.

    Each batch taken is acknowledged, with the playhead. From the first on, the server is ahead of
    the playhead by Limits.lead_s at most, however slowly this program reads. A lost connection is
    restored as by `MotionStream`; commands under way then raise Unavailable, and may have been
    carried out.
    """

    def __init__(
        self, connection: Connection, request: motion_pb2.StreamMotionRequest, deadline: float
    ) -> None:
        self._connection = connection
        self._request = request
        self._deadline = deadline
        self._reader = BatchReader()
        self._call: Any = None
        self._writing = asyncio.Lock()  # grpc.aio ends a call that is written to twice at once
        self._replies: dict[int, asyncio.Future[int]] = {}
        self._number = 0
        self._opened = asyncio.Event()
        self._ended: WayfarerError | None = None
        self._batches: asyncio.Queue[Batch | WayfarerError | None] = asyncio.Queue()
        self._following: asyncio.Task[None] | None = None
        self._view: motion_pb2.Viewpoints | None = None  # not sent yet
        self._looking: asyncio.Task[None] | None = None
        self._refused: WayfarerError | None = None
        self.reconnections = 0

    async def __aenter__(self) -> Self:
        self._following = asyncio.create_task(self._follow(), name="wayfarer control")
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for task in (self._looking, self._following):
            if task is not None:
                task.cancel()
                await asyncio.wait({task})

    @property
    def info(self) -> StreamInfo | None:
        """The header of the present connection; None before the first batch."""
        return self._reader.info

    @property
    def resume_token(self) -> str:
        """The resume token of the last batch that was received."""
        return self._request.resume_token

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Batch:
        item = await self._batches.get()
        if isinstance(item, Batch):
            await self._acknowledge(item)
            return item
        self._batches.put_nowait(item)  # for the next reader
        if item is None:
            raise StopAsyncIteration
        raise item

    async def ack(self, playhead: float, resume_token: str = "") -> None:
        """Reports what is on the screen now, in Unix seconds of the server's clock.

        Taking a batch reports the time of its first frame; a program that plays with a delay
        reports it more precisely.
        """
        if self._call is None:
            return
        message = control_pb2.Ack(
            resume_token=resume_token or self.resume_token, playhead_us=round(playhead * 1e6)
        )
        await self._write(control_pb2.ControlRequest(ack=message))

    async def look(self, *viewpoints: Viewpoint) -> None:
        """See the agents from these places, in a stream with `interest`. Call it as often as the
        camera moves: ten calls a second at most are sent, and always the last.

        A restored connection begins with the last ones. Raises the server's error about earlier
        viewpoints, if it refused them.
        """
        if not self._request.HasField("interest"):
            raise FailedPrecondition("the stream was opened without `interest`")
        if self._refused is not None:
            refused, self._refused = self._refused, None
            raise refused
        self._view = motion_pb2.Viewpoints(viewpoints=[view.to_wire() for view in viewpoints])
        del self._request.interest.viewpoints[:]
        self._request.interest.viewpoints.extend(self._view.viewpoints)
        if self._looking is None or self._looking.done():
            self._looking = asyncio.create_task(self._look(), name="wayfarer viewpoints")

    async def _look(self) -> None:
        """Sends the viewpoints until they are at rest."""
        while self._view is not None and self._ended is None:
            view, self._view = self._view, None
            with contextlib.suppress(Unavailable):  # the next connection begins with them
                await self._opened.wait()
                await self._write(control_pb2.ControlRequest(command_id=VIEW_ID, viewpoints=view))
            await asyncio.sleep(VIEW_INTERVAL_S)

    async def _give(self, request: Message) -> int:
        """Carries out a request of GoalService over this connection."""
        if self._ended is not None:
            raise self._ended
        try:
            async with asyncio.timeout(self._connection.timeout):
                await self._opened.wait()
                return await self._ask({FIELDS[request.DESCRIPTOR.full_name]: request})
        except TimeoutError:
            raise Unavailable(f"no reply within {self._connection.timeout:g} s") from None

    async def _ask(self, payload: dict[str, Any]) -> int:
        if self._ended is not None:
            raise self._ended
        self._number += 1
        number = self._number
        reply: asyncio.Future[int] = asyncio.get_running_loop().create_future()
        self._replies[number] = reply
        try:
            await self._write(control_pb2.ControlRequest(command_id=number, **payload))
            return await reply
        finally:
            del self._replies[number]

    async def _write(self, request: control_pb2.ControlRequest) -> None:
        try:
            async with self._writing:
                await self._call.write(request)
        except Exception as error:  # grpc.aio raises various errors on a call that is over
            raise Unavailable(f"the connection is lost: {error}") from None

    async def _acknowledge(self, batch: Batch) -> None:
        if batch.frames and batch.resume_token:
            try:
                await self.ack(float(batch.frames[0].times[0]), batch.resume_token)
            except Unavailable:
                return  # the next connection resumes from the last batch received

    # the connection

    async def _follow(self) -> None:
        end: WayfarerError | None = None
        try:
            async for batch in self._received():
                self._keep(batch)
        except WayfarerError as error:
            end = error
        finally:
            self._ended = end or Unavailable("the control stream has ended")
            self._hang_up(self._ended)
            self._opened.set()  # those waiting for a connection see that none will come
            self._batches.put_nowait(end)

    async def _received(self) -> AsyncGenerator[Batch]:
        backoff = Backoff(self._deadline)
        route = self._connection.route(self._request)
        while True:
            try:
                async for batch in self._once(backoff, route):
                    yield batch
                return
            except (Misdirected, Unavailable, ResourceExhausted) as error:
                if refuses(error) and self.info is None:
                    raise
                self._hang_up(Unavailable(f"the connection was lost: {error}"))
                if not (goes_on(route, error) and isinstance(error, Misdirected)):
                    if not await backoff.pause(error.retry_after):
                        raise Unavailable(f"no stream for {self._deadline:g} s: {error}") from None
                    route.begin()
                self.reconnections += 1

    async def _once(self, backoff: Backoff, route: Route) -> AsyncGenerator[Batch]:
        self._call = self._connection.open(route, self._connection.control.Control)
        try:
            await self._write(control_pb2.ControlRequest(open=self._request))
            while (message := await heard(self._call)) is not None:
                backoff.succeeded()
                route.answered()
                if message.HasField("reply"):
                    self._answer(message.reply)
                    continue
                batch = read(message.motion, self._reader)
                self._opened.set()
                if batch is None:
                    await self._keep_up(message.motion)
                    continue
                if batch.resume_token:
                    self._request.resume_token = batch.resume_token
                yield batch
        finally:
            self._call.cancel()

    async def _keep_up(self, message: motion_pb2.StreamMotionResponse) -> None:
        """Advances the playhead while nothing moves: motion may begin again at any time."""
        if message.HasField("heartbeat") and self._batches.empty():
            await self.ack(message.sent_at_us / 1e6)

    def _answer(self, reply: control_pb2.CommandReply) -> None:
        waiting = self._replies.get(reply.command_id)
        if reply.command_id == VIEW_ID:
            self._refused = from_problem(reply.problem)
        if waiting is None or waiting.done():
            return
        if reply.HasField("problem"):
            waiting.set_exception(from_problem(reply.problem))
        else:
            waiting.set_result(reply.revision)

    def _hang_up(self, error: WayfarerError) -> None:
        self._opened.clear()
        for waiting in self._replies.values():
            if not waiting.done():
                waiting.set_exception(error)

    def _keep(self, batch: Batch) -> None:
        """Queue it for the program, which gets an event if it reads too late."""
        if self._batches.qsize() >= QUEUE:
            self._batches.get_nowait()
            lost = Event("gap", batch.sent_at, None, 0, 0, "this program did not read in time")
            batch = replace(batch, events=(lost, *batch.events))
        self._batches.put_nowait(batch)
