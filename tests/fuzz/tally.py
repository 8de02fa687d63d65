"""What a server made of its inputs."""

import asyncio
from collections import Counter
from dataclasses import dataclass, field

KEPT = 25
"""Inputs that went wrong and are shown."""


@dataclass
class Tally:
    """Answers by surface; failures with what makes them come again."""

    answers: Counter[tuple[str, str]] = field(default_factory=Counter)  # surface, answer
    kinds: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)
    failed: int = 0

    @property
    def inputs(self) -> int:
        """All so far."""
        return self.answers.total()

    def answer(self, surface: str, kind: str, answer: str) -> None:
        """An input of a kind got an answer that is in order."""
        self.answers[surface, answer] += 1
        self.kinds[kind] += 1

    def failure(self, surface: str, kind: str, answer: str, target: str, data: bytes) -> None:
        """One that must not be."""
        self.answer(surface, kind, answer)
        self.failed += 1
        if len(self.failures) < KEPT:
            shown = data[:200].hex() + ("…" if len(data) > 200 else "")
            what = f"{surface} {target} ({kind}, {len(data)} bytes)"
            self.failures.append(f"{what}: {answer}: {shown}")

    def of(self, surface: str) -> dict[str, int]:
        """Answers of a surface, the most frequent first."""
        found = {name: n for (where, name), n in self.answers.items() if where == surface}
        return dict(sorted(found.items(), key=lambda item: -item[1]))


class Quota:
    """So many inputs for all workers of a surface together."""

    def __init__(self, inputs: int) -> None:
        self.left = inputs

    async def take(self) -> bool:
        """Whether one more is to be sent."""
        await asyncio.sleep(0)
        self.left -= 1
        return self.left >= 0
