"""A short run of benchmarks/fuzz.py against the real process."""

import asyncio

from tests.fuzz.campaign import SETTINGS, run
from tests.serving import LIGHT, Service

INPUTS = 1000


async def test_hostile_inputs_do_no_harm():
    with Service(settings=LIGHT | SETTINGS) as server:
        async with asyncio.timeout(300):
            report = await run(server.target, INPUTS, seed=7, healthy_agents=2)
        assert report.answers.inputs >= INPUTS
        assert report.answers.failures == []
        assert server.errors == []
        assert (report.failed_turns, report.resets) == (0, 0)
        assert report.stream.chunks > 0
        # Bounded caches (body meshes) and heaps still fill, by 19 MB. Whether memory is flat over
        # 100,000 inputs is checked by benchmarks/fuzz.py.
        assert report.growth_megabytes < 60
