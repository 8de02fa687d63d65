import pytest

from tests.runtime.servers import Servers


@pytest.fixture
async def servers():
    made = Servers()
    yield made
    for runtime in list(made.running):
        await made.stop(runtime)
