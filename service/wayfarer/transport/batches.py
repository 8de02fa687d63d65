"""The runtime's publications as wire messages, in one basis and format."""

from collections.abc import AsyncGenerator, AsyncIterator, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from wayfarer import __version__
from wayfarer.runtime.agent import AgentInfo, AgentState, Event, EventKind, MotionChunk, Publication
from wayfarer.spec import FPS
from wayfarer.transport import convert, schema, wire
from wayfarer.transport.basis import Basis
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.codec import PoseEncoder, PoseFormat
from wayfarer.v1 import agent_pb2, catalog_pb2, common_pb2, motion_pb2

STATES: Final = {state: f"AGENT_STATE_{state.name}" for state in AgentState}
KINDS: Final = {kind: f"EVENT_KIND_{kind.name}" for kind in EventKind}


@dataclass(frozen=True)
class BatchWriter:
    """Writes what one reader gets."""

    basis: Basis
    pose_format: PoseFormat
    encoder: PoseEncoder
    bodies: BodyLibrary
    skeleton: schema.Skeleton

    def header(
        self, session_id: str = "", resume_s: float = 0.0, resumed: bool = False
    ) -> motion_pb2.StreamHeader:
        """What holds for all that follows."""
        return motion_pb2.StreamHeader(
            server_version=__version__,
            session_id=session_id,
            fps=FPS,
            basis=wire.message(common_pb2.BasisInfo, convert.basis_info(self.basis)),
            skeleton=wire.message(catalog_pb2.Skeleton, self.skeleton),
            resume_s=resume_s,
            resumed=resumed,
            **self.pose_format.header(),
        )

    def batch(
        self,
        chunks: Sequence[MotionChunk],
        added: Iterable[AgentInfo] = (),
        removed: Iterable[int] = (),
        resume_token: str = "",
    ) -> motion_pb2.MotionBatch:
        """Chunks that fell due together; `added` are the agents that the reader sees first here."""
        packed = self.encoder.encode(chunks, self.basis, self.pose_format)
        return motion_pb2.MotionBatch(
            added=[self.agent(info) for info in added],
            removed=removed,
            resume_token=resume_token,
            chunks=[
                motion_pb2.MotionChunk(
                    alias=chunk.alias,
                    seq=chunk.seq,
                    first_frame=chunk.first_frame + poses.skipped,
                    scheduled_at_us=convert.microseconds(chunk.scheduled_at + poses.skipped / FPS),
                    goal_revision=chunk.goal_revision,
                    state=STATES[chunk.state],
                    flags=int(chunk.flags),
                    poses=poses.poses,
                    contacts=poses.contacts,
                    waypoint=chunk.waypoint,
                    candidates=chunk.candidates,
                )
                for chunk, poses in zip(chunks, packed, strict=True)
            ],
        )

    async def offline(
        self, made: AsyncIterator[Publication]
    ) -> AsyncGenerator[tuple[motion_pb2.StreamHeader | None, motion_pb2.MotionBatch | None]]:
        """A header, then batches, of motion that is made off the real-time path.

        The header comes when the first motion has: what is refused is refused before it.
        """
        headed = False
        async for published in made:
            if not headed:
                yield self.header(), None
                headed = True
            yield None, self.batch(published.chunks, published.added)

    def agent(self, info: AgentInfo) -> agent_pb2.Agent:
        """An agent as the reader sees it."""
        return wire.message(agent_pb2.Agent, convert.agent(info, self.basis, self.bodies))


def event_message(event: Event) -> motion_pb2.Event:
    """Field by field."""
    return motion_pb2.Event(
        kind=KINDS[event.kind],
        agent_id=event.agent_id,
        alias=event.alias,
        at_us=convert.microseconds(event.at),
        goal_revision=event.goal_revision,
        waypoint=event.waypoint,
        detail=event.detail,
    )
