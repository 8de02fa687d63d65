"""Two models of one server, compared: the same people over themselves."""

import json
from hashlib import sha256
from pathlib import Path
from shutil import copytree
from urllib.request import Request, urlopen

import numpy as np

from tests.serving import Service
from tests.viewer.chromium import CONNECTION, Page, needs_chromium
from wayfarer.models.bundle import DEFAULT_MODEL

pytestmark = needs_chromium

SHARED_SERVER = False  # it loads a second model
SIZE = (900, 600)
PEOPLE = "globalThis.wayfarer?.crowd.people"
SHOWN = f"{PEOPLE}?.filter(({{ shown }}) => shown).length"
TAKES = """Promise.all(wayfarer.replay.takes.map(({ id }) => wayfarer.api.agents(id)))
  .then((takes) => takes.map((people) => people.map(({ model, seed }) => [model, seed])))"""
APART = """(({ people }) => {
  const [one, other] = people.map(({ played: { frame } }) => frame);
  return Math.max(...one.map((value, k) => Math.abs(value - other[k])));
})(wayfarer.crowd)"""


def other_model(folder: Path) -> None:
    """The shipped model with slightly different weights, as after some more training."""
    copytree(DEFAULT_MODEL, folder)
    weights = np.fromfile(folder / "weights.bin", np.float32)
    noise = np.random.default_rng(3).normal(1, 0.01, weights.shape)
    (weights * noise).astype(np.float32).tofile(folder / "weights.bin")
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["files"]["weights.bin"] = sha256((folder / "weights.bin").read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))


def test_a_link_shows_people_over_themselves_as_another_model_moves_them(
    page: Page, tmp_path: Path, shots: Path | None
):
    other_model(tmp_path / "v2")
    with Service("--models-dir", str(tmp_path)) as service:
        load = Request(
            f"{service.url}/v1/admin/models",
            b'{"name": "v2"}',
            {"content-type": "application/json"},
        )
        with urlopen(load) as answer:
            assert answer.status == 201
        page.call("Page.navigate", url=f"{service.url}/?detail=low&scene=corridor&people=0&look=0")
        page.wait_for(f"globalThis.wayfarer?.book.version >= 0 && {CONNECTION} === 'open'", 60)
        page.evaluate("document.querySelector('#add-one').click()")
        page.wait_for(f"{SHOWN} === 1", 60)
        page.evaluate("wayfarer.tools.send({ x: -12, y: 0, z: 0 })")
        page.wait_for("wayfarer.history.last - wayfarer.history.first > 1", 60)
        page.evaluate("document.querySelector('#share').click()")
        page.wait_for("document.querySelector('#share-address').value", 10)
        page.evaluate(
            "(() => { const beside = document.querySelector('#share-beside');"
            " beside.value = 'model:v2'; beside.dispatchEvent(new Event('change')); })()"
        )
        address = page.evaluate("document.querySelector('#share-address').value")
        page.call("Page.navigate", url="about:blank")
        page.call("Page.navigate", url=address)
        page.wait_for(f"{SHOWN} === 2", 60)
        (shipped, seed), (other, same) = (take[0] for take in page.evaluate(TAKES))
        assert (shipped, other) == (DEFAULT_MODEL.name, "v2") and seed == same
        legend = page.evaluate("document.querySelector('#legend').innerText")
        assert legend.split("\n") == [f"model {DEFAULT_MODEL.name}", "model v2"]
        # the pose of the first moment is common to both
        page.wait_for("wayfarer.player.moment > wayfarer.replay.begins + 3", 60)
        assert 0.01 < page.evaluate(APART) < 4
        if shots:
            (shots / "models.png").write_bytes(page.screenshot())
        page.call("Page.navigate", url="about:blank")
        page.call("Page.navigate", url=address.replace("model%3Av2", "model%3Av3"))
        page.wait_for("document.querySelector('#messages')?.textContent.includes('v3')", 30)
        page.wait_for(f"{CONNECTION} === 'open'", 60)  # a new session instead
        assert [problem for problem in page.problems if "404" not in problem] == []
