"""Sessions that leave a server or come to it, while its motion thread has no room for a command."""

from types import SimpleNamespace

import pytest

from wayfarer.errors import NotFound, Unavailable
from wayfarer.transport.gateway.moves import SessionMoves

NAME = "session-00ff00"


class Full:
    """Service, sessions and scenes; each call of the service finds the queue full at first."""

    def __init__(self):
        self.released, self.thawed = [], []
        self.moves = self.service = self.sessions = self.scenes = self
        self.full = True

    def close(self, name):
        pass

    def _room(self):
        self.full = not self.full
        if not self.full:
            raise Unavailable("4096 commands are waiting already; try again")

    async def release(self, name, error):
        self._room()
        self.released.append(name)

    async def unfreeze(self, name):
        self._room()
        if name != NAME:
            raise NotFound(name)
        self.thawed.append(name)


async def test_what_has_another_owner_is_ended_and_what_stays_goes_on_though_the_queue_is_full():
    full = Full()
    moves = SessionMoves(SimpleNamespace(service=full, sessions=full, scenes=full))
    await moves.release(NAME, None)
    await moves.thaw(NAME)
    assert full.released == full.thawed == [NAME]
    with pytest.raises(NotFound):
        await moves.thaw("session-00ff01")
