"""The page /docs: all of it from this server, and alive in a real browser."""

import asyncio
import re
from collections.abc import Callable

from tests.viewer.chromium import Page, needs_chromium
from tests.web_host import web_host

INFO = "#operations-catalogue-getServerInfo"


async def test_nothing_of_the_page_comes_from_elsewhere(rig):
    moved = await rig.http.get("/docs")
    assert moved.is_redirect and moved.headers["location"] == "docs/"
    page = await rig.http.get("/docs/")
    assert page.headers["content-type"].startswith("text/html")
    assert "script-src 'self' 'wasm-unsafe-eval';" in page.headers["content-security-policy"]
    assert "://" not in page.text
    parts = re.findall(r'(?:src|href)="([^"]+)"', page.text)
    parts = [part for part in parts if not part.startswith("data:")]
    assert len(parts) >= 4
    for part in parts:
        assert (await rig.http.get(f"/docs/{part}")).status_code == 200, part
    assert (await rig.http.get("/redoc")).status_code == 404


@needs_chromium
async def test_it_lists_the_calls_and_makes_them(rig, tmp_path):
    def visit() -> None:
        with Page(tmp_path / "profile") as page:
            page.call("Page.navigate", url=f"{rig.server.http_url}/docs")
            page.wait_for("document.querySelectorAll('.opblock').length > 40", 60)
            _press(page, f"{INFO} .opblock-summary-control")
            _press(page, f"{INFO} .try-out__btn")
            _press(page, f"{INFO} .execute")
            page.wait_for(
                f"document.querySelector('{INFO} .live-responses-table .response') !== null"
            )
            told = page.evaluate(
                f"document.querySelector('{INFO} .live-responses-table').innerText"
            )
            assert "200" in told and '"fps": 40' in told
            assert page.problems == []

    await asyncio.to_thread(visit)


@needs_chromium
async def test_no_other_page_can_show_it_in_a_frame(rig, tmp_path):
    def visit() -> None:
        for shown in ("/docs/", "/"):
            (tmp_path / "index.html").write_text(f'<iframe src="{rig.server.http_url}{shown}">')
            with (
                web_host(tmp_path, address="127.0.0.2") as elsewhere,  # no page of this machine
                Page(tmp_path / f"profile{len(shown)}") as page,
            ):
                page.call("Page.navigate", url=elsewhere)
                _until(page, lambda page: any("frame-ancestors" in p for p in page.problems))

    await asyncio.to_thread(visit)


def _press(page: Page, selector: str) -> None:
    page.wait_for(f"!!document.querySelector('{selector}')")
    page.evaluate(f"document.querySelector('{selector}').click()")


def _until(page: Page, found: Callable[[Page], bool]) -> None:
    for _ in range(100):
        page.evaluate("new Promise((done) => setTimeout(done, 100))")
        if found(page):
            return
    raise AssertionError(f"framed; problems: {page.problems}")
