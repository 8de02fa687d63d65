"""A headless Chromium page over the DevTools protocol: just what a test of a page needs."""

import base64
import itertools
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.request import urlopen

import pytest
from websockets.sync.client import connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu-sandbox",
    "--disable-dev-shm-usage",
    "--enable-unsafe-swiftshader",
    "--use-angle=swiftshader",
    "--remote-debugging-port=0",
    "--no-first-run",
    "--disable-extensions",
    "--disable-background-networking",
    "--mute-audio",
)


def find_chromium() -> str | None:
    """Path of a browser, or None."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


needs_chromium = pytest.mark.skipif(
    find_chromium() is None, reason="no Chromium on this machine: apt-get install chromium"
)

CONNECTION = "document.querySelector('#connection').dataset.state"


class Page:
    """One tab, a context manager; `problems` collects errors of console, scripts, network."""

    def __init__(self, profile: Path, size: tuple[int, int] = (1000, 640)) -> None:
        """Raises RuntimeError where there is no browser."""
        executable = find_chromium()
        if executable is None:
            raise RuntimeError("there is no Chromium here: apt-get install chromium")
        self.url = ""
        """URL of the server that it shows."""
        width, height = size
        command = [executable, *FLAGS, f"--window-size={width},{height}"]
        self.problems: list[str] = []
        self._numbers = itertools.count(1)
        self._process = subprocess.Popen(
            [*command, f"--user-data-dir={profile}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            port = self._port(profile / "DevToolsActivePort")
            with urlopen(f"http://127.0.0.1:{port}/json/list") as answer:
                target = next(t for t in json.load(answer) if t["type"] == "page")
            self._stack = ExitStack()
            address = target["webSocketDebuggerUrl"]
            # without pings: on a busy machine the browser answers them too late
            self._socket = self._stack.enter_context(
                connect(address, max_size=None, ping_interval=None)
            )
        except BaseException:
            self._process.kill()
            raise
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def __enter__(self) -> "Page":
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    @property
    def process_id(self) -> int:
        """Process id of the browser."""
        return self._process.pid

    def call(self, method: str, **params: object) -> dict:
        """A DevTools command and its result; events on the way are looked at for problems."""
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            self._note(message)

    def evaluate(self, script: str) -> object:
        """Value of a JavaScript expression; promises are awaited."""
        result = self.call(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in result:
            raise RuntimeError(f"{script}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def wait_for(self, script: str, seconds: float = 30) -> object:
        """Wait until an expression is true, and return it. Raises TimeoutError with `problems`."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if value := self.evaluate(script):
                return value
            time.sleep(0.1)
        raise TimeoutError(f"not true after {seconds} s: {script}; problems: {self.problems}")

    def resize(self, width: int, height: int) -> None:
        """Another size of the window; a small one is a phone's."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def click(self, x: float, y: float) -> None:
        """Press and release the left button at a point of the page (CSS pixels)."""
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def drag(
        self, start: tuple[float, float], end: tuple[float, float], shift: bool = False
    ) -> None:
        """Press the left button at one point, move, and release it at another."""
        held = {"modifiers": 8 if shift else 0, "button": "left", "clickCount": 1}
        for kind, (x, y) in (("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **held)

    def drop(self, file: Path, x: float, y: float) -> None:
        """Drag a file from outside onto a point of the page."""
        data = {"items": [], "files": [str(file)], "dragOperationsMask": 1}
        for kind in ("dragEnter", "dragOver", "drop"):
            self.call("Input.dispatchDragEvent", type=kind, x=x, y=y, data=data)

    def choose(self, selector: str, file: Path) -> None:
        """Choose a file with an input of the page."""
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        node = self.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.call("DOM.setFileInputFiles", files=[str(file)], nodeId=node)

    def freeze(self, seconds: float) -> None:
        """Another tab comes to the front, and the browser freezes this one; then it is back."""
        own = self.call("Target.getTargetInfo")["targetInfo"]["targetId"]
        other = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.wait_for("document.hidden", 10)
        self.call("Page.setWebLifecycleState", state="frozen")
        time.sleep(seconds)
        self.call("Page.setWebLifecycleState", state="active")
        self.call("Target.activateTarget", targetId=own)
        self.wait_for("!document.hidden", 20)
        self.call("Target.closeTarget", targetId=other)

    def screenshot(self) -> bytes:
        """The page as PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def _note(self, event: dict) -> None:
        method, params = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.problems.append(json.dumps(params["exceptionDetails"])[:500])
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.problems.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.problems.append(" ".join(str(a.get("value", a)) for a in params["args"])[:500])

    def _port(self, file: Path) -> int:
        end = time.monotonic() + 30
        while time.monotonic() < end:
            if self._process.poll() is not None:
                raise RuntimeError(f"the browser ended with code {self._process.returncode}")
            if file.exists() and (lines := file.read_text().splitlines()):
                return int(lines[0])
            time.sleep(0.05)
        raise TimeoutError("the browser did not open its DevTools port within 30 s")


REST = """{
  const { requestAnimationFrame: ask, cancelAnimationFrame: forget } = globalThis;
  const asked = new Map();
  let [count, drawn] = [0, 0];
  globalThis.requestAnimationFrame = (draw) => {
    const number = ++count;
    const begin = () => asked.set(number, [forget, ask((now) => {
      asked.delete(number);
      draw(now);
      drawn = performance.now();
    })]);
    asked.set(number, [clearTimeout, setTimeout(begin, drawn + 100 - performance.now())]);
    return number;
  };
  globalThis.cancelAnimationFrame = (number) => {
    const [stop, what] = asked.get(number) ?? [];
    stop?.(what);
    asked.delete(number);
  };
}"""
"""A script: a tenth of a second without work between two pictures.

Without a graphics card pictures of a page that waits would take both cores from other tests.
"""


@contextmanager
def resting_tab(profile: Path) -> Iterator[Page]:
    """A tab that rests between two pictures."""
    with Page(profile) as opened:
        opened.call("Page.addScriptToEvaluateOnNewDocument", source=REST)
        yield opened
