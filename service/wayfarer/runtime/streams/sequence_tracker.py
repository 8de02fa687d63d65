"""Marks FIRST and GAP on the chunks of a subscriber, by the chunks that it lacks."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

from wayfarer.runtime.streams.publications import Publication
from wayfarer.world.agents.agent import ChunkFlag, MotionChunks

SILENCE: Final = 10.0
"""Seconds of motion after which an agent without a chunk is forgotten, deleted ones included."""


class SequenceTracker:
    """The last sequence number of each agent that the reader received, for marking chunks."""

    def __init__(self) -> None:
        # Two generations: an agent in neither has had no chunk for at least `SILENCE`.
        self._new: dict[int, int] = {}  # by alias
        self._old: dict[int, int] = {}
        self._next_turn = SILENCE

    def learn(self, publications: Iterable[Publication], position: int) -> None:
        """Learns what a reader that resumes after `position` has received before."""
        got, next_ = dict[int, int](), dict[int, int]()
        for publication in publications:
            aliases, seqs = _numbers(publication.chunks)
            if publication.position <= position:
                got.update(zip(aliases, seqs, strict=True))
            else:
                next_ = dict(zip(aliases, seqs, strict=True)) | next_
        if position > 0:
            # agents that continued after the chunk before was sent, whether or not it is held
            self._new = {alias: seq - 1 for alias, seq in next_.items() if seq > 0} | got

    def put(self, publication: Publication, motion: float) -> Publication:
        """The publication with flagged chunks; `motion` seconds of motion came before it."""
        if motion >= self._next_turn:
            self._new, self._old = {}, self._new
            self._next_turn = motion + SILENCE
        aliases, seqs = _numbers(publication.chunks)
        last = list(map(self._new.get, aliases))
        if None in last:
            last = [
                self._old.get(a) if s is None else s for a, s in zip(aliases, last, strict=True)
            ]
        self._new.update(zip(aliases, seqs, strict=True))
        if last == [seq - 1 for seq in seqs]:
            return publication
        return replace(publication, chunks=_marked(publication.chunks, last))


def _numbers(chunks: MotionChunks) -> tuple[list[int], list[int]]:
    return chunks.alias.tolist(), chunks.seq.tolist()


def _marked(chunks: MotionChunks, last: Sequence[int | None]) -> MotionChunks:
    """Flags chunks whose predecessor is not `last`, the last number of the agent."""
    flags = chunks.flags.copy()
    for row, (seq, before) in enumerate(zip(chunks.seq.tolist(), last, strict=True)):
        if before is None:
            flags[row] |= ChunkFlag.FIRST
        elif seq != before + 1:
            flags[row] |= ChunkFlag.GAP
    return replace(chunks, flags=flags)
