import pytest

from tests.serving import Service


@pytest.fixture(scope="session")
def real_server():
    """The shipped model; one server for all clients."""
    with Service() as running:
        yield running
