"""Streams, clips, lock-step."""

import secrets
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager
from itertools import chain

from wayfarer.errors import InvalidArgument
from wayfarer.service.streams.publications import StreamOptions
from wayfarer.transport import convert, schema
from wayfarer.transport.batches import event_message, parsed
from wayfarer.transport.caller import Scope, current_caller
from wayfarer.transport.gateway.context import GatewayContext, needs
from wayfarer.transport.gateway.session_registry import OpenSession
from wayfarer.transport.resume import Progress, filter_mark
from wayfarer.transport.stream import MotionStream
from wayfarer.v1 import motion_pb2
from wayfarer.world.events import Event


class MotionApi:
    """MotionService."""

    def __init__(self, shared: GatewayContext) -> None:
        self._shared = shared

    @needs(Scope.READ)
    async def stream(self, wish: schema.StreamRequest) -> AsyncGenerator[bytes]:
        """Messages until the session ends, each a StreamMotionResponse, encoded. Close it with
        `aclose`.

        Raises NotFound, InvalidArgument, ResourceExhausted, FailedPrecondition, Unavailable.
        """
        async with self.follow(wish) as (_, messages):
            async for message in messages:
                yield message

    @needs(Scope.READ)
    async def events(self, wish: schema.StreamRequest) -> AsyncGenerator[tuple[str, Event] | None]:
        """Events with their resume tokens, None for a sign of life. Otherwise as `stream`."""
        async with self._followed(wish) as (_, stream), aclosing(stream.events()) as events:
            async for event in events:
                yield event

    @asynccontextmanager
    async def follow(
        self, wish: schema.StreamRequest
    ) -> AsyncIterator[tuple[MotionStream, AsyncGenerator[bytes]]]:
        """A stream, for its acknowledgements, and its messages. Raises as `stream`."""
        pose_format = convert.pose_format(wish.format)
        async with self._followed(wish) as (session, stream):
            writer = self._shared.writer(session.basis, pose_format)
            messages = stream.messages(writer, self._shared.limits.resume_s)
            async with aclosing(messages):
                yield stream, messages

    @needs(Scope.CONTROL)
    async def generate_clip(
        self, wish: schema.ClipRequest
    ) -> AsyncGenerator[motion_pb2.GenerateClipResponse]:
        """A header, then batches in order of time. Close it with `aclose`.

        Raises InvalidArgument, ResourceExhausted, Unavailable.
        """
        shared, limits = self._shared, self._shared.limits
        shared.require_ready()
        if wish.seconds > limits.clip_s:
            raise InvalidArgument(
                f"a clip has {limits.clip_s:g} s at most, not {wish.seconds:g}", "seconds"
            )
        if len(wish.goals) > limits.path_goals:
            raise InvalidArgument(
                f"a path has {limits.path_goals} goals at most, not {len(wish.goals)}", "goals"
            )
        writer = self._shared.writer(wish.basis, convert.pose_format(wish.format))
        seed = secrets.randbits(32)
        spec = convert.agent_spec(wish.agent, wish.basis, shared.bodies, seed)
        goals = [convert.goal(goal, wish.basis) for goal in wish.goals]
        made = shared.service.generate_clip(spec, goals, wish.seconds, wish.until_arrival)
        with convert.in_basis(wish.basis.axes):
            async with aclosing(writer.offline(made)) as parts:
                async for header, batch in parts:
                    yield motion_pb2.GenerateClipResponse(header=header, batch=batch)

    @needs(Scope.CONTROL)
    async def step(
        self, session_id: str, wish: schema.StepRequest
    ) -> motion_pb2.StepAgentsResponse:
        """Let primitives pass in a lock-step session.

        Raises NotFound, InvalidArgument, FailedPrecondition.
        """
        shared = self._shared
        session = shared.book.session(session_id)
        steps, most = wish.steps or 1, shared.limits.steps_per_call
        if steps > most:
            raise InvalidArgument(f"1 to {most} primitives per call, not {steps}", "steps")
        writer = self._shared.writer(session.basis, convert.pose_format(wish.format))
        with shared.book.held(session):
            published = await shared.service.step_session(session_id, steps)
            infos = {info.alias: info for info in await shared.service.list_agents(session_id)}
        new = [set(p.chunks.alias[p.chunks.seq == 0].tolist()) & infos.keys() for p in published]
        return motion_pb2.StepAgentsResponse(
            batches=[
                parsed(writer.batch(p.chunks, (infos[alias] for alias in sorted(aliases))))
                for p, aliases in zip(published, new, strict=True)
            ],
            events=map(event_message, chain.from_iterable(p.events for p in published)),
        )

    @asynccontextmanager
    async def _followed(
        self, wish: schema.StreamRequest
    ) -> AsyncIterator[tuple[OpenSession, MotionStream]]:
        shared = self._shared
        shared.require_ready()
        caller = current_caller()
        session = shared.book.session(wish.session_id)
        if len(wish.agent_ids) > shared.limits.agents_per_session:
            raise InvalidArgument(f"{shared.limits.agents_per_session} agents at most", "agent_ids")
        since = Progress.read(wish.resume_token)
        followed = filter_mark(wish.agent_ids)
        if since and session.scene:
            agents = await shared.service.list_agents(wish.session_id)
            shared.book.know_agents(session, agents)
        with shared.book.place(caller, session) as place:
            subscription = await shared.service.subscribe(
                wish.session_id,
                StreamOptions(
                    wish.agent_ids,
                    wish.slow_reader,
                    since.resume(followed) if since else None,
                    hold_s=session.lease_s,
                ),
            )
            try:
                place.stream = MotionStream(
                    shared.service,
                    wish.session_id,
                    subscription,
                    shared.clock,
                    followed,
                    since,
                    session.gone if since else (),
                )
                yield session, place.stream
            finally:
                await subscription.close()
