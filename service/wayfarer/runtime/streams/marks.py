"""What a subscriber has not got: FIRST and GAP, marked on the chunks that it gets."""

from collections.abc import Iterable
from dataclasses import replace
from operator import is_
from typing import Final

from wayfarer.runtime.agent import ChunkFlag, MotionChunk, Publication

SILENCE: Final = 10.0
"""An agent without a chunk for so many seconds of motion is forgotten, deleted ones with it."""


class Marks:
    """The last sequence number of each agent that the reader has got, to mark chunks by."""

    def __init__(self) -> None:
        # Two generations: who is in neither has been silent for `SILENCE` at least.
        self._new: dict[str, int] = {}
        self._old: dict[str, int] = {}
        self._next_turn = SILENCE

    def learn(self, publications: Iterable[Publication], position: int) -> None:
        """What a reader that resumes after `position` has got before."""
        got, next_ = dict[str, int](), dict[str, int]()
        for publication in publications:
            for chunk in publication.chunks:
                if publication.position <= position:
                    got[chunk.agent_id] = chunk.seq
                else:
                    next_.setdefault(chunk.agent_id, chunk.seq)
        if position > 0:
            # Who went on after it had sent the chunk before it, held or not.
            self._new = {name: seq - 1 for name, seq in next_.items() if seq > 0} | got

    def put(self, publication: Publication, motion: float) -> Publication:
        """The publication, its chunks flagged; `motion` seconds of motion came before it."""
        if motion >= self._next_turn:
            self._new, self._old = {}, self._new
            self._next_turn = motion + SILENCE
        chunks = tuple([self._mark(chunk) for chunk in publication.chunks])
        if all(map(is_, chunks, publication.chunks)):
            return publication
        return replace(publication, chunks=chunks)

    def _mark(self, chunk: MotionChunk) -> MotionChunk:
        name = chunk.agent_id
        last = self._new.get(name)
        if last is None:
            last = self._old.get(name)
        self._new[name] = chunk.seq
        if last is None:
            return replace(chunk, flags=chunk.flags | ChunkFlag.FIRST)
        if chunk.seq != last + 1:
            return replace(chunk, flags=chunk.flags | ChunkFlag.GAP)
        return chunk
