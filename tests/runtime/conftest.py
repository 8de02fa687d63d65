import pytest
import structlog


@pytest.fixture(scope="package", autouse=True)
def plain_logs():
    """As the service logs: no tracebacks drawn with the values of all variables."""
    before = structlog.get_config()
    structlog.configure(
        processors=[structlog.processors.format_exc_info, structlog.processors.KeyValueRenderer()]
    )
    yield
    structlog.configure(**before)
