"""A publisher with a manual clock, and its readers' batches."""

import asyncio

from tests.runtime.chunks import KeepingMeter, chunk, info, together
from tests.world.fakes import make_world
from wayfarer.config.limits import Limits
from wayfarer.runtime.streams.publications import SlowReader, StreamOptions
from wayfarer.runtime.streams.publisher import Publisher
from wayfarer.runtime.streams.subscription import Subscription
from wayfarer.world.agents.agent import ChunkFlag

ARRIVED = ChunkFlag.ARRIVED
HOLD = SlowReader.HOLD


class Stage:
    """A publisher with a manual clock; the test plays the motion thread, too."""

    def __init__(self, **settings):
        self.settings = Limits(**settings)
        self.meter = KeepingMeter()
        self.info = info()
        self.now = 0.0
        self.publisher = Publisher(
            self.settings, self.meter, lambda agent_id: self.info, make_world().faults
        )
        self.seq = 0

    async def subscribe(self, *agent_ids, session="s", resume=None, **options):
        made = Subscription(
            session,
            StreamOptions(agent_ids, resume=resume, **options),
            self.settings,
            self.meter,
            lambda: self.now,
        )
        self.publisher.subscribe(made, self.now)
        await asyncio.sleep(0)
        return made

    async def walk(self, count, *agents, session="s"):
        """Publish `count` chunks of each agent, one publication each, and deliver them."""
        for _ in range(count):
            chunks = together(*(chunk(self.seq, agent) for agent in agents or ("a",)))
            self.now = chunks[0].scheduled_at
            self.publisher.publish(session, chunks)
            self.seq += 1
        self.publisher.flush()
        await asyncio.sleep(0)

    async def live(self, seconds, **options):
        """As the loop does: publish, unless the session waits. Returns how many left."""
        left = 0
        for _ in range(round(seconds / 0.2)):
            self.now += 0.2
            if self.publisher.waiting_sessions(self.now):
                continue
            self.publisher.publish("s", together(chunk(self.seq, at=self.now)))
            self.publisher.flush()
            await asyncio.sleep(0)
            self.seq += 1
            left += 1
        return left


async def take(subscription, count):
    async with asyncio.timeout(1):
        return [await anext(subscription) for _ in range(count)]


def seqs(publications):
    return [p.chunks[0].seq for p in publications]


def kinds(publication):
    return [event.kind for event in publication.events]
