"""schemathesis against a server: requests made of its OpenAPI, sound and unsound, all checks on."""

import asyncio
import json
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz import campaign
from tests.fuzz.http_calls import LEFT_OUT

CONFIGURATION = Path(__file__).with_name("schemathesis.toml")
PHASES = "examples,coverage,fuzzing,stateful"
SETTINGS = campaign.SETTINGS | {
    "WAYFARER_LIMITS__CLIP_S": "1",  # otherwise it would spend its time walking
}
"""Settings of the server."""


@dataclass(frozen=True)
class Outcome:
    """Results; `text` is for people."""

    cases: int
    failures: int  # different ones
    errors: int  # of schemathesis itself
    text: str


async def schemathesis(
    url: str, examples: int, seed: int, folder: Path, phases: str = PHASES
) -> Outcome:
    """Tries up to `examples` examples per operation and phase; `folder` is for its files."""
    report = folder / "schemathesis.json"
    process = await asyncio.create_subprocess_exec(
        str(Path(sys.executable).with_name("schemathesis")),
        *("--config-file", str(CONFIGURATION), "run", f"{url}/openapi.json"),
        *("--checks", "all", "--phases", phases),
        *("--max-examples", str(examples), "--seed", str(seed)),
        *("--generation-database", "none", "--continue-on-failure", "--no-color"),
        *("--request-timeout", "60", "--max-response-time", "60"),  # no test of speed
        *("--suppress-health-check", "all"),
        *("--report", "json", "--report-json-path", str(report)),
        *(word for path in LEFT_OUT for word in ("--exclude-path", path)),
        cwd=folder,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.STDOUT,
    )
    try:
        said, _ = await process.communicate()
    finally:
        if process.returncode is None:
            process.kill()
    text = said.decode(errors="replace")
    assert report.exists() and report.stat().st_size, text
    found = json.loads(report.read_text())
    cases = found["test_cases"]
    return Outcome(cases["generated"], cases["unique_failures"], len(found["errors"]), text)
