"""The runtime's publications as wire messages, in one basis and format."""

from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing
from dataclasses import dataclass
from typing import Final

import numpy as np

from wayfarer import __version__
from wayfarer.service.streams.publications import Publication
from wayfarer.spec import FPS
from wayfarer.transport import convert, schema, wire
from wayfarer.transport.basis import Basis
from wayfarer.transport.bodies import BodyLibrary
from wayfarer.transport.codec import PoseEncoder, PoseFormat
from wayfarer.transport.framing import Part, field
from wayfarer.v1 import agent_pb2, catalog_pb2, common_pb2, motion_pb2
from wayfarer.world.agents.agent import STATES, AgentInfo, MotionChunks
from wayfarer.world.events import Event, EventKind

STATE_NUMBERS: Final = np.array(
    [agent_pb2.AgentState.Value(f"AGENT_STATE_{state.name}") for state in STATES]
)
"""Enum value on the wire of each state, in the order of STATES."""

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
        """The header of a stream."""
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
        chunks: MotionChunks,
        added: Iterable[AgentInfo] = (),
        removed: Iterable[int] = (),
        resume_token: str = "",
    ) -> list[Part]:
        """A MotionBatch, encoded; `added` are the agents that the reader sees first here."""
        news = motion_pb2.MotionBatch(
            added=[self.agent(info) for info in added], removed=removed, resume_token=resume_token
        )
        batch: list[Part] = [news.SerializeToString()]
        if chunks:
            batch += field(motion_pb2.MotionBatch.CHUNKS_FIELD_NUMBER, self._chunks(chunks))
        return batch

    def _chunks(self, chunks: MotionChunks) -> list[Part]:
        """A MotionChunks, encoded."""
        packed = self.encoder.encode(chunks, self.basis, self.pose_format)
        columns = motion_pb2.MotionChunks(
            aliases=chunks.alias.tolist(),
            seqs=chunks.seq.tolist(),
            first_frames=chunks.first_frame.tolist(),
            scheduled_at_us=np.rint(chunks.scheduled_at * 1e6).astype(np.int64).tolist(),
            goal_revisions=chunks.goal_revision.tolist(),
            states=STATE_NUMBERS[chunks.state].tolist(),
            flags=chunks.flags.tolist(),
            waypoints=chunks.waypoint.tolist(),
            candidates=chunks.candidates.tolist(),
        )
        return [
            columns.SerializeToString(),
            *field(motion_pb2.MotionChunks.POSES_FIELD_NUMBER, [packed.poses]),
            *field(motion_pb2.MotionChunks.CONTACTS_FIELD_NUMBER, [packed.contacts]),
        ]

    async def offline(
        self, made: AsyncGenerator[Publication]
    ) -> AsyncGenerator[tuple[motion_pb2.StreamHeader | None, motion_pb2.MotionBatch | None]]:
        """A header, then batches, of motion that is made off the real-time path.

        The header comes when the first motion has: what is refused is refused before it.
        """
        headed = False
        async with aclosing(made):
            async for published in made:
                if not headed:
                    yield self.header(), None
                    headed = True
                yield None, parsed(self.batch(published.chunks, published.added))

    def agent(self, info: AgentInfo) -> agent_pb2.Agent:
        """An agent as the reader sees it."""
        return wire.message(agent_pb2.Agent, convert.agent(info, self.basis, self.bodies))


def parsed(batch: Iterable[Part]) -> motion_pb2.MotionBatch:
    """The message that `BatchWriter.batch` has encoded."""
    return motion_pb2.MotionBatch.FromString(b"".join(batch))


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
