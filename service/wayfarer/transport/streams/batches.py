"""The runtime's publications as wire messages, in one basis and format."""

from collections.abc import AsyncGenerator, Iterable
from contextlib import aclosing
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from wayfarer import __version__
from wayfarer.runtime.streams.publications import Publication
from wayfarer.runtime.streams.root_tracks import Roots
from wayfarer.spec import FPS
from wayfarer.transport import schema
from wayfarer.transport.codec import PackedPoses, PoseEncoder, PoseFormat
from wayfarer.transport.conversion import convert, wire
from wayfarer.transport.conversion.basis import Axes, Basis
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.streams.framing import Part
from wayfarer.transport.streams.framing import field as wire_field
from wayfarer.v1 import agent_pb2, catalog_pb2, common_pb2, motion_pb2
from wayfarer.world.agents.agent import STATES, AgentInfo, MotionChunks
from wayfarer.world.events import Event, EventKind

STATE_NUMBERS: Final = np.array(
    [agent_pb2.AgentState.Value(f"AGENT_STATE_{state.name}") for state in STATES]
)
"""Wire number of each state, in the order of STATES."""

COLUMN_BYTES: Final = 64
"""Maximum bytes that a chunk adds to a batch beyond its frames: nine varints."""

KINDS: Final = {kind: f"EVENT_KIND_{kind.name}" for kind in EventKind}


@dataclass(frozen=True)
class BatchWriter:
    """Writes the messages of one reader."""

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
        """Encodes a MotionBatch; `added` are the agents that the reader sees for the first time."""
        batch = motion_pb2.MotionBatch(
            added=[self.agent(info) for info in added], removed=removed, resume_token=resume_token
        )
        return _with_chunks(batch, chunks, self.pack(chunks) if chunks else None)

    def pack(self, chunks: MotionChunks) -> PackedPoses:
        """Packs the chunks' poses, once for all readers. Thread-safe."""
        return self.encoder.encode(chunks, self.basis, self.pose_format)

    def portion(
        self,
        batch: motion_pb2.MotionBatch,
        chunks: MotionChunks,
        rows: NDArray[np.intp],
        roots: Roots | None,
    ) -> list[Part]:
        """Encodes a MotionBatch with the chunks `rows` of a publication, and their `roots`."""
        if not len(rows):
            return _with_chunks(batch, chunks, None)
        packed = self.encoder.encode(chunks, self.basis, self.pose_format, rows, roots)
        return _with_chunks(batch, chunks, packed, rows)

    def row_bytes(self, chunks: MotionChunks) -> int:
        """Maximum bytes of a chunk in a batch."""
        frames = -(-chunks.translation.shape[1] // self.pose_format.stride)
        return COLUMN_BYTES + frames * (self.pose_format.frame_bytes + 1)

    def tier(self, radius: float) -> motion_pb2.Tier:
        """The header's description of a ring; `radius` in metres."""
        return motion_pb2.Tier(
            radius=self.basis.axes.length_to_wire(radius), **self.pose_format.header()
        )

    async def offline(
        self, made: AsyncGenerator[Publication]
    ) -> AsyncGenerator[tuple[motion_pb2.StreamHeader | None, motion_pb2.MotionBatch | None]]:
        """Yields a header, then batches, of motion that is made off the real-time path.

        The header follows the first motion, so that a refusal comes before the header.
        """
        headed = False
        async with aclosing(made):
            async for published in made:
                if not headed:
                    yield self.header(), None
                    headed = True
                yield None, parsed(self.batch(published.chunks, published.added))

    def agent(self, info: AgentInfo) -> agent_pb2.Agent:
        """Describes an agent for the reader."""
        return wire.message(agent_pb2.Agent, convert.agent(info, self.basis, self.bodies))


def _with_chunks(
    batch: motion_pb2.MotionBatch,
    chunks: MotionChunks,
    packed: PackedPoses | None,
    rows: NDArray[np.intp] | slice = slice(None),
) -> list[Part]:
    """Encodes the batch with the chunks of `rows`, whose poses are `packed`."""
    if packed is None:
        return [batch.SerializeToString()]
    columns = motion_pb2.MotionChunks(
        aliases=chunks.alias[rows].tolist(),
        seqs=chunks.seq[rows].tolist(),
        first_frames=chunks.first_frame[rows].tolist(),
        scheduled_at_us=np.rint(chunks.scheduled_at[rows] * 1e6).astype(np.int64).tolist(),
        goal_revisions=chunks.goal_revision[rows].tolist(),
        states=STATE_NUMBERS[chunks.state[rows]].tolist(),
        flags=chunks.flags[rows].tolist(),
        waypoints=chunks.waypoint[rows].tolist(),
        candidates=chunks.candidates[rows].tolist(),
    )
    encoded = [
        columns.SerializeToString(),
        *wire_field(motion_pb2.MotionChunks.POSES_FIELD_NUMBER, [packed.poses]),
        *wire_field(motion_pb2.MotionChunks.CONTACTS_FIELD_NUMBER, [packed.contacts]),
    ]
    return [
        batch.SerializeToString(),
        *wire_field(motion_pb2.MotionBatch.CHUNKS_FIELD_NUMBER, encoded),
    ]


def parsed(batch: Iterable[Part]) -> motion_pb2.MotionBatch:
    """Parses a message that `BatchWriter.batch` encoded."""
    return motion_pb2.MotionBatch.FromString(b"".join(batch))


def event_message(event: Event, axes: Axes) -> motion_pb2.Event:
    """Converts an event; its sentence has lengths and places in the basis of these axes."""
    return motion_pb2.Event(
        kind=KINDS[event.kind],
        agent_id=event.agent_id,
        alias=event.alias,
        at_us=convert.microseconds(event.at),
        goal_revision=event.goal_revision,
        waypoint=event.waypoint,
        detail=convert.written(event.text, axes),
    )
