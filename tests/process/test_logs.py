import json
import sys

import pytest

from tests.programs import run_program
from wayfarer.process.logs import HIDDEN, hidden

PROGRAM = """
import logging, structlog
from wayfarer.process.logs import configure_logging
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
    answer = run_program(sys.executable, "-c", PROGRAM.format(form=form))
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


GONE = """
import logging
from wayfarer.process.logs import GRPC, configure_logging
configure_logging("info", "json")
grpcio = logging.getLogger(GRPC)
grpcio.error("ExecuteBatchError raised in core by servicer method [/wayfarer.v1.M/Stream]")
grpcio.error("Unexpected [KeyError] raised by servicer method [/wayfarer.v1.M/Stream]")
logging.getLogger("library").error("ExecuteBatchError raised in core by us")
"""


def test_a_reader_who_leaves_in_the_middle_is_no_error():
    answer = run_program(sys.executable, "-c", GONE)
    told = [json.loads(line)["event"] for line in answer.stderr.splitlines()]
    assert [line.split()[0] for line in told] == ["Unexpected", "ExecuteBatchError"]
    assert "by us" in told[1]


KEY = "wf_Zm9vYmFyYmF6cXV4Zm9vYmFyYmF6cXV4"
TOKEN = "eyJhbGciOiJFUzI1NiIsImtpZCI6Im9uZSJ9.eyJzdWIiOiJhZGEifQ.c2lnbmF0dXJl"
SECRETS = f"""
import logging, structlog
from wayfarer.process.logs import configure_logging
configure_logging("debug", "{{form}}")
log = structlog.get_logger("test")
log.info("key {KEY}", authorization="Bearer opaque-1", x_api_key="opaque-2", token="opaque-3")
log.info("call", path="/v1/stream?token=opaque-4&session=s", headers={{{{"a": ["{TOKEN}"]}}}})
logging.getLogger("library").warning("got Authorization: Bearer opaque-5, from %s", "{KEY}")
logging.getLogger("library").warning("https://ada:opaque-6@issuer.example/jwks?api_key=opaque-7")
structlog.contextvars.bind_contextvars(cookie="opaque-8")
try:
    raise ValueError("no such token: {TOKEN}") from KeyError("wayfarer.token.b3BhcXVlLTk")
except ValueError:
    log.exception("broken")
"""


@pytest.mark.parametrize("form", ["json", "text"])
def test_no_key_or_token_in_any_line(form):
    lines = run_program(sys.executable, "-c", SECRETS.format(form=form)).stderr
    for secret in (KEY, TOKEN, "opaque", "b3BhcXVl"):
        assert secret not in lines
    assert "[hidden]" in lines and "session=s" in lines and "issuer.example" in lines
    if form == "json":
        assert all(json.loads(line) for line in lines.splitlines())


@pytest.mark.parametrize(
    "text",
    ["tokens=3 keys=5", "wf_short", "bearer of good news", "https://issuer.example/jwks", "a:b@c"],
)
def test_other_text_stays(text):
    assert hidden(text) in (text, text.replace("of", HIDDEN))
