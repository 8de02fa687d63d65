"""Streams, clips, lock-step."""

import secrets
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Sequence
from contextlib import aclosing, asynccontextmanager
from itertools import chain

from wayfarer.errors import InvalidArgument
from wayfarer.runtime.streams.publications import Publication, StreamOptions
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoding, PoseFormat
from wayfarer.transport.conversion import convert
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.conversion.motion_files import motion_file, parts_of
from wayfarer.transport.edge.caller import Scope, current_caller
from wayfarer.transport.gateway.context import GatewayContext, implements, needs
from wayfarer.transport.gateway.goals import path
from wayfarer.transport.gateway.session_registry import OpenSession
from wayfarer.transport.streams.batches import event_message, parsed
from wayfarer.transport.streams.detail_levels import DetailLevels
from wayfarer.transport.streams.resume import Progress, filter_mark
from wayfarer.transport.streams.stream import MotionStream
from wayfarer.v1 import motion_pb2
from wayfarer.world.agents.agent import MotionChunks


class MotionApi:
    """MotionService."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context

    @implements("StreamMotion")
    async def stream(self, request: schema.StreamRequest) -> AsyncGenerator[bytes]:
        """Yields messages until the session ends, each an encoded StreamMotionResponse. Close it
        with `aclose`.

        Raises NotFound, InvalidArgument, ResourceExhausted, FailedPrecondition, Unavailable.
        """
        async with self.follow(request) as (_, messages):
            async for message in messages:
                yield message

    @needs(Scope.READ)
    async def events(
        self, request: schema.StreamRequest
    ) -> AsyncGenerator[tuple[str, motion_pb2.Event] | None]:
        """Yields events with their resume tokens, and None as a heartbeat; see `stream`."""
        async with self._followed(request) as (_, stream), aclosing(stream.events()) as events:
            async for event in events:
                yield event

    @implements("Control")
    @asynccontextmanager
    async def follow(
        self, request: schema.StreamRequest
    ) -> AsyncIterator[tuple[MotionStream, AsyncGenerator[bytes]]]:
        """Opens a stream, for acknowledgements, and its messages. Raises as `stream`."""
        self._context.require_ready()
        most = request.max_message_bytes
        if 0 < most < schema.MIN_MESSAGE_BYTES:
            raise InvalidArgument(
                f"is {most}; allowed: 0, or {schema.MIN_MESSAGE_BYTES} at least",
                "max_message_bytes",
            )
        usual = convert.stream_format(request.format)
        session = self._context.sessions.session(request.session_id)
        interest = _levels(request.interest, usual, session.basis)
        formats = [ring.pose_format for ring in interest.rings] if interest else [usual]
        writers = [self._context.writer(session.basis, each) for each in formats]
        has_poses = usual.encoding is not PoseEncoding.ROOT
        is_whole = has_poses and not (interest or most or request.agent_ids)
        pack = writers[0].pack if is_whole else None
        async with self._followed(request, formats, interest, pack) as (_, stream):
            messages = stream.messages(writers, self._context.limits.resume_s, most)
            async with aclosing(messages):
                yield stream, messages

    @implements("GenerateClip")
    async def generate_clip(
        self, request: schema.ClipRequest
    ) -> AsyncGenerator[motion_pb2.GenerateClipResponse]:
        """Yields a header, then batches in order of time; or the parts of a file. Close it with
        `aclose`.

        Raises InvalidArgument, ResourceExhausted, Unavailable.
        """
        context = self._context
        writer = context.writer(request.basis, convert.pose_format(request.format))
        options = None if request.file is None else convert.file_options(request.file)
        made = self._made(request)
        with convert.in_basis(request.basis.axes):
            if options is not None:
                name = request.agent.name or "motion"
                for part in parts_of(await motion_file(made, options, context.bodies.name, name)):
                    yield motion_pb2.GenerateClipResponse(file_part=part)
                return
            async with aclosing(writer.offline(made)) as parts:
                async for header, batch in parts:
                    yield motion_pb2.GenerateClipResponse(header=header, batch=batch)

    def _made(self, request: schema.ClipRequest) -> AsyncGenerator[Publication]:
        context, limits = self._context, self._context.limits
        context.require_ready()
        if request.seconds > limits.clip_s:
            raise InvalidArgument(
                f"a clip has {limits.clip_s:g} s at most, not {request.seconds:g}", "seconds"
            )
        if len(request.goals) > limits.path_goals:
            raise InvalidArgument(
                f"a path has {limits.path_goals} goals at most, not {len(request.goals)}", "goals"
            )
        seed = secrets.randbits(32)
        spec = convert.agent_spec(request.agent, request.basis, context.bodies, seed)
        goals = path(request.goals, request.basis.axes)
        return context.service.generate_clip(spec, goals, request.seconds, request.until_arrival)

    @implements("StepAgents")
    async def step(
        self, session_id: str, request: schema.StepRequest
    ) -> motion_pb2.StepAgentsResponse:
        """Advances a lock-step session by some primitives.

        Raises NotFound, InvalidArgument, FailedPrecondition.
        """
        context = self._context
        session = context.sessions.session(session_id)
        steps, most = request.steps or 1, context.limits.steps_per_call
        if steps > most:
            raise InvalidArgument(f"1 to {most} primitives per call, not {steps}", "steps")
        writer = self._context.writer(session.basis, convert.pose_format(request.format))
        with context.sessions.held(session):
            published = await context.service.step_session(session_id, steps)
            infos = {info.alias: info for info in await context.service.list_agents(session_id)}
        new = [set(p.chunks.alias[p.chunks.seq == 0].tolist()) & infos.keys() for p in published]
        return motion_pb2.StepAgentsResponse(
            batches=[
                parsed(writer.batch(p.chunks, (infos[alias] for alias in sorted(aliases))))
                for p, aliases in zip(published, new, strict=True)
            ],
            events=[
                event_message(event, session.basis.axes)
                for event in chain.from_iterable(p.events for p in published)
            ],
        )

    @asynccontextmanager
    async def _followed(
        self,
        request: schema.StreamRequest,
        formats: Sequence[PoseFormat] = (),
        interest: DetailLevels | None = None,
        pack: Callable[[MotionChunks], object] | None = None,
    ) -> AsyncIterator[tuple[OpenSession, MotionStream]]:
        context = self._context
        context.require_ready()
        caller = current_caller()
        session = context.sessions.session(request.session_id)
        if len(request.agent_ids) > context.limits.agents_per_session:
            raise InvalidArgument(
                f"{context.limits.agents_per_session} agents at most", "agent_ids"
            )
        since = Progress.read(request.resume_token)
        followed = filter_mark(request.agent_ids)
        with context.sessions.place(caller, session) as place:
            subscription = await context.service.subscribe(
                request.session_id,
                StreamOptions(
                    request.agent_ids,
                    request.slow_reader,
                    since.resume(followed) if since else None,
                    hold_s=session.lease_s,
                    roots=any(each.encoding is PoseEncoding.ROOT for each in formats),
                    events_only=not formats,
                    sights=interest.sights if interest else None,
                    pack=pack,
                ),
            )
            try:
                # the last await before the stream opens: from then on the stream itself sees
                # deletions
                gone = await self._gone(session) if since else []
                place.stream = MotionStream(
                    context.service,
                    request.session_id,
                    subscription,
                    context.clock,
                    followed,
                    since,
                    gone,
                    interest,
                    session.basis.axes,
                )
                yield session, place.stream
            finally:
                await subscription.close()

    async def _gone(self, session: OpenSession) -> list[int]:
        """Aliases of deleted agents that a resuming reader may still show."""
        if not session.scene:
            return session.gone()
        return session.gone(await self._context.service.list_agents(session.session_id))


def _levels(
    interest: schema.Interest | None, usual: PoseFormat, basis: Basis
) -> DetailLevels | None:
    """The rings and viewpoints with which a stream is opened. Raises InvalidArgument."""
    if interest is None:
        return None
    views = convert.viewpoints(interest.viewpoints, basis.axes, "interest.viewpoints")
    return DetailLevels(convert.rings(interest, usual, basis.axes), views)
