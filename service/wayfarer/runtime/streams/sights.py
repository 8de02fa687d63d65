"""How well one reader sees each agent of its session, for the motion thread: well-seen agents are
stepped first when time is short.
"""

from collections.abc import Iterable

from wayfarer.world.agents.agent import Sight


class Sights:
    """How well one reader sees each agent, for one stream with rings. The stream writes; the motion
    thread may read at any time, since it only looks up single agents.
    """

    def __init__(self) -> None:
        self._by_alias: dict[int, Sight] = {}

    def see(self, sights: Iterable[tuple[int, Sight]]) -> None:
        """Sets how well it sees these agents, by alias, from now on."""
        self._by_alias.update(sights)

    def forget(self, alias: int) -> None:
        """Forgets a deleted agent."""
        self._by_alias.pop(alias, None)

    def of(self, alias: int) -> Sight:
        """How well it sees an agent; one without an entry counts as near."""
        return self._by_alias.get(alias, Sight.NEAR)


def best_of(readers: Iterable[Sights], aliases: Iterable[int]) -> list[Sight]:
    """How well each agent is seen by the reader that sees it best."""
    return [min(column) for column in zip(*(map(r.of, aliases) for r in readers), strict=True)]
