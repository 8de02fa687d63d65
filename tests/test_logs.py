import json
import subprocess
import sys

import pytest

PROGRAM = """
import logging, structlog
from wayfarer.logs import configure_logging
configure_logging("info", "{form}")
log = structlog.get_logger("test")
log.debug("hidden")
log.info("ready", port=1)
logging.getLogger("library").warning("from %s", "below")
logging.getLogger("uvicorn.error").info("chatter")
secret = "password"
try:
    1 / 0
except ZeroDivisionError:
    log.exception("broken")
"""


def run(form: str) -> str:
    answer = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(form=form)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert not answer.stdout
    return answer.stderr


@pytest.mark.parametrize("form", ["json", "auto"])
def test_json_lines(form):
    ready, below, broken = map(json.loads, run(form).splitlines())
    assert (ready["event"], ready["port"], ready["level"]) == ("ready", 1, "info")
    assert (below["event"], below["level"]) == ("from below", "warning")
    assert broken["exception"][0]["exc_type"] == "ZeroDivisionError"
    assert "password" not in json.dumps(broken["exception"])


def test_text():
    lines = run("text")
    assert "ready" in lines and "port=1" in lines and "ZeroDivisionError" in lines
    assert "hidden" not in lines and "chatter" not in lines
