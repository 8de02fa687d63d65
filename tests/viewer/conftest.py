"""One server and one browser for all tests of the page that run in this process."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.serving import Service
from tests.viewer.chromium import Page, find_chromium


@pytest.fixture(scope="package")
def viewer_url() -> Iterator[str]:
    """Of the server named by VIEWER_URL, or of one that is started here."""
    if "VIEWER_URL" in os.environ:
        yield os.environ["VIEWER_URL"]
        return
    with Service() as service:
        yield service.url


@pytest.fixture(scope="package")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A tab; each module has its own size and address."""
    executable = find_chromium()
    assert executable
    with Page(executable, tmp_path_factory.mktemp("profile"), (1000, 640)) as opened:
        yield opened


@pytest.fixture(scope="module")
def page(browser: Page, request: pytest.FixtureRequest) -> Iterator[Page]:
    """The tab in the size that the module says (SIZE), as if it had just been opened.

    Its `url` is the server's, unless the module has servers of its own (SHARED_SERVER).
    """
    if getattr(request.module, "SHARED_SERVER", True):
        browser.url = request.getfixturevalue("viewer_url")
    width, height = getattr(request.module, "SIZE", (1000, 640))
    browser.resize(width, height)
    browser.problems.clear()
    yield browser
    browser.call("Page.navigate", url="about:blank")  # its session ends, and its people


@pytest.fixture
def shots() -> Path | None:
    """Where pictures are to be left for somebody to look at; None: nobody asks (VIEWER_SHOTS)."""
    return Path(os.environ["VIEWER_SHOTS"]) if "VIEWER_SHOTS" in os.environ else None
