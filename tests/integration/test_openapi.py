"""A short run of benchmarks/openapi.py against the real process."""

import asyncio

from tests.fuzz.openapi import SETTINGS, schemathesis
from tests.serving import LIGHT, Service


async def test_the_service_does_what_its_document_says(tmp_path):
    with Service(settings=LIGHT | SETTINGS) as server:
        async with asyncio.timeout(300):
            outcome = await schemathesis(server.url, 1, 7, tmp_path, "examples,fuzzing")
        assert (outcome.failures, outcome.errors) == (0, 0), outcome.text
        assert outcome.cases > 30
        assert server.errors == []
