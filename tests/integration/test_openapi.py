"""A short run of benchmarks/openapi.py against the real process."""

import asyncio

from tests.fuzz import campaign
from tests.fuzz.openapi import SETTINGS, schemathesis
from tests.fuzz.server import served
from tests.serving import LIGHT


async def test_the_service_does_what_its_document_says(tmp_path):
    settings = LIGHT | campaign.SETTINGS | SETTINGS
    async with asyncio.timeout(300), served(tmp_path / "log", settings=settings) as server:
        outcome = await schemathesis(server.target.http, 1, 7, tmp_path, "examples,fuzzing")
        assert (outcome.failures, outcome.errors) == (0, 0), outcome.text
        assert outcome.cases > 30
        assert server.errors == []
