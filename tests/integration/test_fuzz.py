"""A short run of benchmarks/fuzz.py against the real process."""

import asyncio

from tests.fuzz.campaign import SETTINGS, run
from tests.fuzz.server import served

INPUTS = 2000


async def test_hostile_inputs_do_no_harm(tmp_path):
    async with asyncio.timeout(300), served(tmp_path / "log", settings=SETTINGS) as server:
        # what is opened once, such as the engine of clips, is open before memory is looked at
        await run(server.target, INPUTS // 5, seed=5, healthy_agents=2)
        report = await run(server.target, INPUTS, seed=7, healthy_agents=2)
        assert report.answers.inputs >= INPUTS
        assert report.answers.failures == []
        assert server.errors == []
        assert (report.failed_turns, report.resets) == (0, 0)
        assert report.stream.chunks > 0
        assert report.growth_megabytes < 40  # a leak of 20 kB for each input would be 40
