"""A server's answers to inputs."""

import asyncio
from collections import Counter
from dataclasses import dataclass, field

KEPT = 25
"""Maximum number of failed inputs that are shown."""


@dataclass
class Tally:
    """Answers by surface; failures with the data to reproduce them."""

    answers: Counter[tuple[str, str]] = field(default_factory=Counter)  # surface, answer
    kinds: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)
    failed: int = 0

    @property
    def inputs(self) -> int:
        """Number of all inputs so far."""
        return self.answers.total()

    def answer(self, surface: str, kind: str, answer: str) -> None:
        """Counts an acceptable answer to an input of a kind."""
        self.answers[surface, answer] += 1
        self.kinds[kind] += 1

    def failure(self, surface: str, kind: str, answer: str, target: str, data: bytes) -> None:
        """Counts an answer that must not occur."""
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
    """Number of inputs for all workers of a surface together."""

    def __init__(self, inputs: int) -> None:
        self.left = inputs

    async def take(self) -> bool:
        """Whether one more should be sent."""
        await asyncio.sleep(0)
        self.left -= 1
        return self.left >= 0
