"""Characters of three.js, three-vrm and Babylon.js in a page of another origin."""

import pytest

from tests.viewer.chromium import needs_chromium
from tests.viewer.conftest import ROOT

pytestmark = [
    needs_chromium,
    pytest.mark.slow,
    pytest.mark.skipif(
        not (ROOT / "clients" / "web" / "node_modules" / "three").is_dir(),
        reason="needs the engines: cd clients/web && npm ci",
    ),
]


def test_an_agent_walks_to_its_goal_on_characters_of_each_engine(page, host_url):
    """The engines draw the pictures; the places of bones are read back from them."""
    address = f"{host_url}/clients/web/test/live_page.html?server={page.url}"
    page.call("Page.navigate", url=address)
    result = page.wait_for("globalThis.result", 120)
    assert "failed" not in result, result
    walked = [line.partition(":")[0] for line in result["walked"] if ": walked to " in line]
    assert walked == ["three", "vrm", "babylon", "glb"]
    assert result["stats"]["gaps"] == 0
    assert not page.problems
