"""Commands with a time limit, and a server that is started, found ready and ended."""

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

WALK = Path(__file__).with_name("walk.py")
PORTS = ("--http-port", "0", "--grpc-port", "0", "--log-format", "json")
READY_S = 120.0
END_S = 30.0


class StepError(Exception):
    """A step that did not end as it should; the text is for the report's reader."""


def run(command: Sequence[str], folder: Path, until: float) -> str:
    """Its output. Raises StepError with the end of the output."""
    quick = {"PIP_COMPILE": "0", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}  # PIP_NO_COMPILE=1 compiles
    words = " ".join(command)
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=clean(os.environ) | quick,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        output, complaints = process.communicate(timeout=max(until - time.monotonic(), 1))
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)  # with the processes that it has started
        process.communicate()
        raise StepError(f"the time was over in `{words}`") from None
    if process.returncode:
        raise StepError(f"`{words}` ended with {process.returncode}:\n{tail(complaints)}")
    return output


def interrupt(process: subprocess.Popen[bytes], said: str) -> None:
    """Ctrl-C: make and the server both get it."""
    os.killpg(process.pid, signal.SIGINT)


@contextmanager
def serving(
    command: Sequence[str],
    folder: Path,
    until: float,
    stop: Callable[[subprocess.Popen[bytes], str], None] = interrupt,
    **environment: str,
) -> Iterator[tuple[str, str]]:
    """The addresses of HTTP and gRPC of a server that is ended afterwards. Raises StepError.

    `stop` is called with the process and its output, and should make the server end cleanly.
    """
    with TemporaryDirectory() as name:
        said = Path(name) / "said"
        with said.open("w") as out:
            process = subprocess.Popen(
                command,
                cwd=folder,
                env=clean(os.environ) | environment,
                stdout=out,
                stderr=out,
                start_new_session=True,
            )
        try:
            ready = wait_for("ready", said, process, min(until, time.monotonic() + READY_S))
            yield ready["http"], ready["grpc"]
            stop(process, said.read_text())
            wait_for("stopped", said, process, time.monotonic() + END_S)
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            raise StepError("the server said that it had stopped, and went on running") from None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        if "Traceback" in said.read_text():
            raise StepError("a trace in its log:\n" + tail(said.read_text()))


def wait_for(
    event: str, said: Path, process: subprocess.Popen[bytes], until: float
) -> dict[str, str]:
    """The line of the log with this event. Raises StepError."""
    while True:
        over = process.poll() is not None or time.monotonic() > until
        for line in said.read_text().splitlines():
            if line.startswith("{") and json.loads(line).get("event") == event:
                return dict(json.loads(line))
        if over:
            raise StepError(f"the server did not say {event!r}:\n" + tail(said.read_text()))
        time.sleep(0.1)


def clean(environment: "os._Environ[str]") -> dict[str, str]:
    """The environment without the caller's variables and make's."""
    of_ours = ("WAYFARER_", "PYTHON", "VIRTUAL_ENV", "MAKE", "MFLAGS", "ORT_", "CI")
    return {name: value for name, value in environment.items() if not name.startswith(of_ours)}


def tail(text: str) -> str:
    """The last lines, set in."""
    return "\n".join(f"    {line}" for line in text.splitlines()[-25:])
