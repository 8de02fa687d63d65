"""A server that asks for a key, stops, and starts again."""

import sys
from pathlib import Path
from urllib.request import Request, urlopen

import pytest

from tests.programs import run_program
from tests.serving import Service, free_port
from tests.viewer.chromium import CONNECTION, Page, needs_chromium
from tests.viewer.stage import NAMES, PEOPLE, SHOWN

pytestmark = needs_chromium

SHARED_SERVER = False  # it starts its own
EYE = "wayfarer.stage.camera.position.toArray()"
CRATES = "[...wayfarer.level.obstacles.keys()]"
TOLD = "['messages', 'news'].map((id) => document.getElementById(id).textContent).join()"


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    made = run_program(sys.executable, "-m", "wayfarer", "keys", "new", "tester")
    file = tmp_path_factory.mktemp("keys") / "keys.toml"
    file.write_text(made.stdout)
    return next(word for word in made.stderr.split() if word.startswith("wf_")), file


def test_after_a_restart_everybody_is_there_again(page: Page, keys, tmp_path: Path):
    """They return from the server, or from the page if the server has forgotten them."""
    key, file = keys
    port = str(free_port())
    options = ("--http-port", port, "--keys-file", str(file))
    with Service(*options, "--state-dir", str(tmp_path)) as first:
        page.call(
            "Page.navigate",
            url=f"{first.url}/?detail=low&scene=corridor&people=0&encoding=smallest_three&fps=20",
        )
        page.wait_for("document.querySelector('#access')?.open", 60)
        assert page.evaluate("document.querySelector('#access-reason').textContent")
        page.evaluate(
            f"(() => {{ document.querySelector('#access-token').value = '{key}';"
            " document.querySelector('#access button').click(); })()"
        )
        page.wait_for(f"globalThis.wayfarer?.book.version >= 0 && {CONNECTION} === 'open'", 30)
        for _ in range(2):
            page.evaluate("document.querySelector('#add-one').click()")
        page.wait_for(f"{SHOWN} === 2", 60)
        header = page.evaluate("globalThis.wayfarer.player.header")
        assert (header["encoding"], header["sentFps"]) == (3, 20)
        page.evaluate("wayfarer.book.addCrate({ x: 5, y: 0, z: 0 })")
        page.wait_for(f"{CRATES}.length === 1 && wayfarer.book.version > 0", 20)
        names, crates = page.evaluate(NAMES), page.evaluate(CRATES)
        session = page.evaluate("wayfarer.session")
        assert key not in "".join(first.said)
    page.wait_for("document.querySelector('#connection').textContent === 'reconnecting'", 20)
    page.wait_for(f"({TOLD}).includes('when the server is back')", 5)
    with Service(*options, "--state-dir", str(tmp_path)):
        page.wait_for(f"{CONNECTION} === 'open'", 60)
        shown = page.evaluate("globalThis.wayfarer.player.stats.chunks")
        page.wait_for(f"globalThis.wayfarer.player.stats.chunks > {shown} + 4", 30)
        assert page.evaluate("wayfarer.session") == session
        assert page.evaluate(NAMES) == names and page.evaluate(CRATES) == crates
        page.evaluate(f"wayfarer.selection.choose([{PEOPLE}[0]])")
        chosen = page.evaluate(f"{PEOPLE}[0].agent.name")
        eye = page.evaluate(EYE)
        # and now the server forgets all of it, as one without a journal does
        for what in (f"sessions/{session}", f"scenes/{page.evaluate('wayfarer.book.id')}"):
            gone = Request(f"{first.url}/v1/{what}", method="DELETE", headers={"x-api-key": key})
            urlopen(gone).close()
        page.wait_for(f"({TOLD}).includes('2 people and 1 crate come back')", 60)
        page.wait_for(f"wayfarer.session && wayfarer.session !== '{session}'", 60)
        page.wait_for(f"{SHOWN} === 2 && {CRATES}.length === 1", 60)
        page.wait_for(f"wayfarer.selection.person?.agent.name === '{chosen}'", 20)
        assert page.evaluate(EYE) == pytest.approx(eye, abs=0.01)
        assert page.evaluate(NAMES) == names and page.evaluate(CRATES) == crates
        page.call("Page.reload")
        page.wait_for(f"globalThis.wayfarer && {CONNECTION} === 'open'", 60)
        assert not page.evaluate("document.querySelector('#access').open")
