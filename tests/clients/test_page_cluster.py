"""The page in a cluster: its node is killed, and it continues at the node that then has its people;
also when that is killed, and only a node is left that came after the page.
"""

import time
from collections.abc import Collection, Iterator
from urllib.request import urlopen

import pytest

from tests.clients.cluster import RunningCluster
from tests.viewer.chromium import CONNECTION, Page, needs_chromium, resting_tab
from tests.viewer.stage import NAMES, SHOWN

pytestmark = needs_chromium

CHUNKS = "globalThis.wayfarer.player.stats.chunks"
ADD = "document.querySelector('#add-one').click()"


@pytest.fixture
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A tab."""
    with resting_tab(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


def test_a_page_whose_node_is_killed_goes_on_at_another(
    cluster: RunningCluster, page: Page
) -> None:
    cluster.until_ready()
    until_they_know_each_other(cluster.nodes())
    page.call("Page.navigate", url=f"{cluster.url}/?detail=low&scene=corridor&people=0")
    page.wait_for(f"globalThis.wayfarer?.book.version >= 0 && {CONNECTION} === 'open'", 60)
    node = page.evaluate("location.origin")
    assert node != cluster.url
    for _ in range(2):
        page.evaluate(ADD)
    page.wait_for(f"{SHOWN} === 2", 60)
    session = page.evaluate("wayfarer.session")
    [other] = cluster.nodes().keys() - {node}
    for shown, killed in ((3, node), (4, other)):
        names = page.evaluate(NAMES)
        time.sleep(2.5)  # all is copied to the neighbour
        cluster.kill(killed)
        page.wait_for(f"{CONNECTION} !== 'open'", 30)
        page.wait_for(f"{CONNECTION} === 'open'", 60)
        before = page.evaluate(CHUNKS)
        page.wait_for(f"{CHUNKS} > {before} + 4", 30)
        assert (page.evaluate("wayfarer.session"), page.evaluate(NAMES)) == (session, names)
        page.evaluate(ADD)  # over HTTP, of another origin than the page
        page.wait_for(f"{SHOWN} === {shown}", 60)
        assert page.evaluate("wayfarer.session") == session
        assert page.evaluate("location.origin") == node
        if killed == node:
            cluster.until_replaced(node)
            [newcomer] = cluster.nodes().keys() - {other}
            page.wait_for(f"wayfarer.api.homes.others.includes('{newcomer}')", 30)
    page.evaluate("void fetch('http://127.0.0.2:9/').catch(() => {})")  # no machine of it
    told = "document.querySelector('#messages').textContent"
    page.wait_for(f"{told}.includes('Go on at http://127.0.0.2:9/?session={session}')", 10)


def until_they_know_each_other(urls: Collection[str]) -> None:
    """A page may call the nodes that its own node knew when it was opened."""
    places = {url.removeprefix("http://") for url in urls}
    ends_at = time.monotonic() + 30
    while time.monotonic() < ends_at:
        policies = [urlopen(url).headers["content-security-policy"].split() for url in urls]
        if all(places <= set(policy) for policy in policies):
            return
        time.sleep(0.1)
    raise TimeoutError(policies)
