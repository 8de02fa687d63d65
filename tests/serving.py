"""`wayfarer serve` as a separate process, for tests that need the real one."""

import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from types import TracebackType
from typing import Self

import httpx
import pytest

HAS_RAY = find_spec("ray") is not None
# `make test` installs it for all Pythons for which there is one: there it is never left out
assert HAS_RAY or not (os.environ.get("CI") and sys.version_info < (3, 15)), "no Ray"
needs_ray = pytest.mark.skipif(not HAS_RAY, reason="pip install '.[cluster]'")
FREE_PORTS = ("--http-port", "0", "--grpc-port", "0")
LIGHT = {
    "WAYFARER_CANDIDATES": "2",
    "WAYFARER_ADMISSION": "false",  # tests share a small machine
    "WAYFARER_ENGINE": "onnxruntime",  # a third of a start is the choice between engines
}


def post(url: str, path: str, document: object) -> httpx.Response:
    """The answer to a POST, from the node that is named where the server has several."""
    answer = httpx.post(url + path, json=document, timeout=60)
    if answer.status_code == httpx.codes.MISDIRECTED_REQUEST:
        node = f"http://127.0.0.1:{answer.json()['endpoint']['http_port']}"
        answer = httpx.post(node + path, json=document, timeout=60)
    return answer


class Service:
    """The shipped model on free ports of this machine; a context manager."""

    def __init__(
        self,
        *options: str,
        before: Sequence[str] = (),
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """`options`: further ones of `wayfarer serve`; `before`: a command that runs it.

        Raises RuntimeError with what it said.
        """
        command = [sys.executable, "-m", "wayfarer", "serve", "--log-format", "json"]
        self.process = subprocess.Popen(
            [*before, *command, *FREE_PORTS, *options],
            env={**environment, **LIGHT},
            stderr=subprocess.PIPE,
            text=True,
        )
        self.said: list[str] = []
        ready: queue.Queue[dict[str, str] | None] = queue.Queue()
        self._listener = threading.Thread(target=self._listen, args=(ready,), daemon=True)
        self._listener.start()
        found = ready.get(timeout=300)  # on a machine with other work
        if found is None:
            raise RuntimeError("the service did not start:\n" + "".join(self.said[-20:]))
        self.url, self.grpc_address = found["http"], found["grpc"]

    def _listen(self, ready: queue.Queue[dict[str, str] | None]) -> None:
        """Take what it says, to its end: a full pipe would stop it."""
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append(line)
            if line.startswith("{") and json.loads(line).get("event") == "ready":
                ready.put(json.loads(line))
        ready.put(None)

    def stop(self) -> None:
        """As SIGTERM does. Safe to call twice."""
        self.process.terminate()
        try:
            self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._listener.join(timeout=20)  # its children have ended, too

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
