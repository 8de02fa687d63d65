"""`wayfarer serve` as a separate process, for tests that need the real one."""

import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from types import TracebackType
from typing import Self

import httpx
import psutil
import pytest

from wayfarer_lab.load.target import Target

HAS_RAY = find_spec("ray") is not None
# `make test` installs it for all Pythons for which there is one: there it is never left out
assert HAS_RAY or not (os.environ.get("CI") and sys.version_info < (3, 15)), "no Ray"
needs_ray = pytest.mark.skipif(not HAS_RAY, reason="pip install '.[cluster]'")
COMMAND = (sys.executable, "-m", "wayfarer", "serve", "--log-format", "json")
ANY_PORTS = ("--http-port", "0", "--grpc-port", "0")
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith("WAYFARER_")}
START_S = 300.0  # on a machine with other work
LIGHT = {
    "WAYFARER_CANDIDATES": "2",
    "WAYFARER_ADMISSION": "false",  # tests share a small machine
    "WAYFARER_ENGINE": "onnxruntime",  # a third of a start is the choice between engines
}


def free_port() -> int:
    """A port of the loopback that was free a moment ago."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


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
        settings: Mapping[str, str] = LIGHT,
        environment: Mapping[str, str] = ENVIRONMENT,
    ) -> None:
        """`options`: further ones of `wayfarer serve`; `before`: a command that runs it;
        `settings`: more variables than those of `environment`. Raises RuntimeError with its log.
        """
        self.process = subprocess.Popen(
            [*before, *COMMAND, *ANY_PORTS, *options],
            env={**environment, **settings},
            stderr=subprocess.PIPE,
            text=True,
        )
        self.said: list[str] = []
        ready: queue.Queue[dict[str, str] | None] = queue.Queue()
        self._listener = threading.Thread(target=self._listen, args=(ready,), daemon=True)
        self._listener.start()
        try:
            found = ready.get(timeout=START_S)
        except queue.Empty:
            found = None
        if found is None:
            self.stop(signal.SIGKILL)
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

    @property
    def log(self) -> list[dict]:
        """The entries of its log; every line that it wrote has to be one."""
        return [json.loads(line) for line in self.said]

    @property
    def errors(self) -> list[str]:
        """Logged events that should not have happened."""
        lines = [json.loads(line) for line in self.said if line.startswith("{")]
        return [str(line)[:2000] for line in lines if line["level"] in ("error", "critical")]

    @property
    def target(self) -> Target:
        """Its addresses and process for the load generator."""
        return Target(self.grpc_address, self.url, (), psutil.Process(self.process.pid))

    def stop(self, how: signal.Signals = signal.SIGTERM) -> int:
        """Its exit code after this signal. Safe to call twice."""
        self.process.send_signal(how)
        return self.ended()

    def ended(self, seconds: float = 20) -> int:
        """Its exit code, once it has ended; after these seconds it is killed."""
        try:
            self.process.wait(timeout=seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._listener.join(timeout=20)  # its children have ended, too
        return self.process.returncode

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
