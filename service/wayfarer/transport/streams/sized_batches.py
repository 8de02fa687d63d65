"""A publication as one reader receives it: batches, one per tier, each of limited size."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfarer.runtime.streams.root_tracks import Roots, RootTracks
from wayfarer.transport.codec import PoseEncoding
from wayfarer.transport.streams.batches import BatchWriter
from wayfarer.transport.streams.framing import Part
from wayfarer.v1 import agent_pb2, motion_pb2
from wayfarer.world.agents.agent import AgentInfo, MotionChunks

Rows = NDArray[np.intp]

NO_ROWS: Final = np.zeros(0, np.intp)

ENVELOPE_BYTES: Final = 256
"""Maximum bytes of a batch beyond chunks, descriptions and aliases: token, times, lengths."""

ALIAS_BYTES: Final = 5
"""Maximum bytes of an alias."""


@dataclass(frozen=True, slots=True)
class VisibleChunks:
    """Chunks that are due together, as one reader sees them."""

    chunks: MotionChunks
    tiers: Rows  # [A] index of the writer; greater ones are not sent
    roots: Roots | None = None  # [A, …]
    added: Mapping[int, AgentInfo] = field(default_factory=dict)  # by alias
    hidden: Sequence[int] = ()  # aliases


class WrittenBatch(NamedTuple):
    """An encoded batch."""

    tier: int
    chunks: int
    parts: list[Part]


@dataclass(frozen=True, slots=True)
class _Portion:
    """The content of one batch."""

    tier: int
    rows: Rows
    added: list[agent_pb2.Agent]


class SizedBatches:
    """Writes the batches of one stream."""

    def __init__(self, writers: Sequence[BatchWriter], most: int = 0) -> None:
        """`writers`: one per tier. `most`: maximum bytes of a message; 0: no limit."""
        self._writers = writers
        self._most = most
        has_poses = writers[0].pose_format.encoding is not PoseEncoding.ROOT
        self._is_whole = len(writers) == 1 and not most and has_poses

    def batches(
        self, shown: VisibleChunks, removed: Sequence[int], before: str, after: str
    ) -> list[WrittenBatch]:
        """Encodes batches; none if there is nothing to send. The last one has the resume token
        `after`, the others `before`, since a client that has only those still lacks the rest.
        """
        if self._is_whole and not shown.tiers.any():
            [writer] = self._writers
            added = shown.added.values()
            is_any = bool(shown.chunks) or bool(removed)
            if not is_any:
                return []
            parts = writer.batch(shown.chunks, added, removed, after)
            return [WrittenBatch(0, len(shown.chunks), parts)]
        portions = list(self._portions(shown, ALIAS_BYTES * (len(removed) + len(shown.hidden))))
        if not portions and (removed or shown.hidden):
            portions = [_Portion(0, NO_ROWS, [])]
        roots, found = shown.roots, list[WrittenBatch]()
        for k, portion in enumerate(portions):
            writer = self._writers[portion.tier]
            if roots is None and writer.pose_format.encoding is PoseEncoding.ROOT:
                roots = RootTracks().follow(shown.chunks)  # it was published without roots
            batch = motion_pb2.MotionBatch(
                added=portion.added,
                removed=removed if k == 0 else (),
                hidden=shown.hidden if k == 0 else (),
                resume_token=after if k == len(portions) - 1 else before,
                tier=portion.tier,
            )
            parts = writer.portion(batch, shown.chunks, portion.rows, roots)
            found.append(WrittenBatch(portion.tier, len(portion.rows), parts))
        return found

    def _portions(self, shown: VisibleChunks, news: int) -> Iterator[_Portion]:
        """`news`: bytes of the first batch that are already taken."""
        left = self._most - ENVELOPE_BYTES - news
        for tier, writer in enumerate(self._writers):
            rows = np.flatnonzero(shown.tiers == tier)
            if not len(rows):
                continue
            aliases = shown.chunks.alias[rows].tolist()
            added = {
                k: writer.agent(shown.added[alias])
                for k, alias in enumerate(aliases)
                if alias in shown.added
            }
            if not self._most:
                yield _Portion(tier, rows, list(added.values()))
                continue
            each, start = writer.row_bytes(shown.chunks), 0
            for k in range(len(rows)):
                size = each + (added[k].ByteSize() + ENVELOPE_BYTES if k in added else 0)
                if size > left and k > start:
                    yield _part(tier, rows, added, start, k)
                    start, left = k, self._most - ENVELOPE_BYTES
                left -= size
            yield _part(tier, rows, added, start, len(rows))
            left = self._most - ENVELOPE_BYTES


def _part(
    tier: int, rows: Rows, added: Mapping[int, agent_pb2.Agent], start: int, end: int
) -> _Portion:
    return _Portion(tier, rows[start:end], [added[k] for k in range(start, end) if k in added])
