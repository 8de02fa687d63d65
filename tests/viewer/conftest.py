"""One server and one browser for all tests of the page that run in this process."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.serving import Service
from tests.viewer.chromium import Page, resting_tab
from tests.web_host import Files, web_host

ROOT = Path(__file__).parents[2]


class HostPage(Files):
    """Another site's page, with the viewer in it (?viewer=URL); the web client's files."""

    FILES = ("/clients/web/", "/tests/golden/")
    REFUSED = "/refused/"
    """Prefix of paths that may not be framed in a page."""

    HTML = """<!doctype html><title>Host</title>
<wayfarer-view scene="corridor" style="width: 500px; height: 300px"></wayfarer-view>
<script type="module">
  await import(`${new URLSearchParams(location.search).get("viewer")}/wayfarer-view.js`);
</script>"""

    def do_GET(self) -> None:  # noqa: N802, as http.server has it
        """Answers with a file, or otherwise with the page."""
        if self.path.startswith(self.FILES):
            super().do_GET()
            return
        self.send_response(200)
        self.send_header("content-type", "text/html")
        if self.path.startswith(self.REFUSED):
            self.send_header("content-security-policy", "frame-ancestors 'none'")
        self.end_headers()
        self.wfile.write(self.HTML.encode())


@pytest.fixture(scope="package")
def host_url() -> Iterator[str]:
    """URL of a page of another origin on this machine, which may embed the viewer."""
    with web_host(ROOT, HostPage) as url:
        yield url


@pytest.fixture(scope="package")
def viewer_url() -> Iterator[str]:
    """URL of the server named by VIEWER_URL, or of a server that is started."""
    if "VIEWER_URL" in os.environ:
        yield os.environ["VIEWER_URL"]
        return
    with Service() as service:
        yield service.url


@pytest.fixture(scope="package")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A tab; each module has its own size and address."""
    with resting_tab(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture(scope="module")
def page(browser: Page, request: pytest.FixtureRequest) -> Iterator[Page]:
    """The tab in the size that the module says (SIZE), as if it had just been opened.

    Its `url` is the server's, unless the module starts its own servers (SHARED_SERVER).
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
    """Folder for pictures that people want to look at (VIEWER_SHOTS); None: not wanted."""
    return Path(os.environ["VIEWER_SHOTS"]) if "VIEWER_SHOTS" in os.environ else None
