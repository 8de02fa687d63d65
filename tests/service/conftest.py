import pytest
import structlog

from tests.service.servers import Servers


@pytest.fixture(scope="package", autouse=True)
def plain_logs():
    """As the service logs: no tracebacks drawn with the values of all variables."""
    before = structlog.get_config()
    structlog.configure(
        processors=[structlog.processors.format_exc_info, structlog.processors.KeyValueRenderer()]
    )
    yield
    structlog.configure(**before)


@pytest.fixture
async def servers():
    made = Servers()
    yield made
    for runtime in list(made.running):
        await made.stop(runtime)
