"""Jobs outside the real-time path: limited in number, bounded, and gone with their reader."""

import asyncio
import threading
import time

import pytest

from tests.runtime.kept_worlds import fake_worlds
from tests.runtime.running import until
from tests.world.fakes import make_world, people
from wayfarer.errors import InvalidArgument, ResourceExhausted
from wayfarer.runtime.offline import Offline
from wayfarer.runtime.walk import walk
from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.agent import AgentState
from wayfarer.world.agents.goal import Goal


async def test_items_come_in_order_and_the_place_is_given_back():
    offline = Offline(1)
    for _ in range(3):
        assert [item async for item in offline.run(lambda: iter(range(5)))] == [0, 1, 2, 3, 4]
        await until(lambda: not offline.running)


async def test_one_job_more_than_allowed_is_refused_at_once():
    offline = Offline(2)
    jobs = [offline.run(lambda: iter(range(100))) for _ in range(3)]
    assert await anext(jobs[0]) == await anext(jobs[1]) == 0
    with pytest.raises(ResourceExhausted, match=r"limits\.offline_jobs") as caught:
        await anext(jobs[2])
    assert caught.value.retry_after > 0
    with pytest.raises(ResourceExhausted), offline.place():
        pass
    await jobs[0].aclose()
    await until(lambda: offline.running == 1)
    assert [item async for item in offline.run(lambda: iter("ab"))] == ["a", "b"]
    await jobs[1].aclose()


async def test_a_slow_reader_gets_one_item_made_ahead_and_no_more():
    made = []

    def items():
        for item in range(1000):
            made.append(item)
            yield item

    job = Offline(1).run(items)
    assert await anext(job) == 0
    await asyncio.sleep(0.1)
    assert len(made) <= 3
    await job.aclose()


async def test_a_reader_who_takes_nothing_for_too_long_loses_the_place():
    offline = Offline(1, patience=0.05)
    job = offline.run(lambda: iter(range(1000)))
    assert await anext(job) == 0
    await until(lambda: not offline.running)
    with pytest.raises(ResourceExhausted, match="nothing was read"):
        await anext(job)


async def test_a_reader_who_goes_away_ends_the_job():
    offline, ended = Offline(1), threading.Event()

    def items():
        try:
            while True:
                time.sleep(0.01)
                yield 0
        finally:
            ended.set()

    async def read():
        async for _ in offline.run(items):
            pass

    reader = asyncio.create_task(read())
    await until(lambda: offline.running)
    await asyncio.sleep(0.05)
    reader.cancel()
    with pytest.raises(asyncio.CancelledError):
        await reader
    await until(lambda: not offline.running and ended.is_set())


async def test_errors_of_a_job_are_its_readers():
    offline = Offline(1)

    def items():
        yield 1
        raise InvalidArgument("goal 3 is too far", "goals[3]")

    job = offline.run(items)
    assert await anext(job) == 1
    with pytest.raises(InvalidArgument, match="goal 3"):
        await anext(job)
    with pytest.raises(InvalidArgument, match="from the start"):
        async for _ in offline.run(refuse):
            pass
    await until(lambda: not offline.running)


def refuse():
    raise InvalidArgument("from the start")


async def test_jobs_run_beside_the_event_loop():
    def items():
        yield threading.get_ident()

    [thread] = [item async for item in Offline(1).run(items)]
    assert thread != threading.get_ident()


# Parts of a clip

GOALS = [Goal((0.0, 2.0, 0.0)), Goal((1.0, 0.0, 0.0))]


def chunks_of(publications):
    return [chunk for published in publications for chunk in published.chunks]


def test_a_clip_has_its_frames_and_counts_from_zero():
    [spec] = people(1)
    publications = list(walk(make_world(), spec, GOALS, 3.05, until_arrival=False))
    chunks = chunks_of(publications)
    assert sum(len(c.translation) for c in chunks) == round(3.05 * 40)
    assert [c.first_frame for c in chunks] == [NEW_FRAMES * n for n in range(len(chunks))]
    assert [c.scheduled_at for c in chunks] == pytest.approx([0.2 * n for n in range(len(chunks))])
    assert {len(c.rotations) for c in chunks[:-1]} == {NEW_FRAMES}
    assert len(chunks[-1].contacts) == len(chunks[-1].translation) == 122 % NEW_FRAMES
    assert [len(p.added) for p in publications] == [1] + [0] * (len(chunks) - 1)


def test_until_arrival_ends_when_the_agent_stands_at_its_last_goal():
    [spec] = people(1)
    chunks = chunks_of(walk(make_world(), spec, GOALS, 60.0, until_arrival=True))
    assert chunks[-1].state is AgentState.STANDING and chunks[-1].waypoint == 1
    assert 3.0 < 0.2 * len(chunks) < 20.0
    x, y, _ = chunks[-1].translation[-1]
    assert abs(x - 1) < 0.3 and abs(y) < 0.3


def test_a_clip_leaves_its_world_empty_however_it_ends():
    [spec] = people(1)
    world = fake_worlds().solo()
    for end in (lambda clip: next(clip), list):
        clip = walk(world, spec, GOALS, 1.0, until_arrival=False)
        end(clip)
        clip.close()
        assert (len(world.registry.agents), len(world.registry.sessions)) == (0, 0)
    with pytest.raises(InvalidArgument, match=r"goals\[1\]\.position"):
        list(walk(world, spec, [GOALS[0], Goal((9e9, 0.0, 0.0))], 1.0, until_arrival=False))
    with pytest.raises(InvalidArgument, match="seconds"):
        list(walk(world, spec, [], 0.0, until_arrival=False))
    assert (len(world.registry.agents), len(world.registry.sessions)) == (0, 0)
