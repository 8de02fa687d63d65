"""Files of the project that no interpreter reads before they are needed: do they fit together?"""

import re
import subprocess
from pathlib import Path

import pytest

from wayfarer import config_sources

ROOT = Path(__file__).parent.parent
DOCKERFILE = (ROOT / "Dockerfile").read_text()


def copied() -> list[str]:
    """Sources of the Dockerfile's COPY lines that come from the project."""
    lines = re.findall(r"^COPY (?!--from)(.+)$", DOCKERFILE, re.MULTILINE)
    return [source for line in lines for source in line.split()[:-1]]


@pytest.mark.parametrize("source", copied())
def test_what_the_image_copies_exists_and_is_not_ignored(source: str) -> None:
    assert (ROOT / source).exists()
    kept = {
        line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line[:1] == "!"
    }
    assert source in kept


def test_the_image_runs_without_root_and_without_torch() -> None:
    final = DOCKERFILE.rsplit("FROM ", 1)[1]
    assert re.search(r"^USER (?!root|0)", final, re.MULTILINE)
    assert "HEALTHCHECK" in final
    assert "[train" not in DOCKERFILE and "torch" not in re.sub("#.*", "", DOCKERFILE)


def test_the_image_sets_what_the_service_knows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Unknown WAYFARER_ variables stop the service, so a stale one would break every container."""
    variables = re.findall(r"(WAYFARER_\w+)=(\S+)", DOCKERFILE)
    for name, value in variables:
        monkeypatch.setenv(name, value)
    assert variables and config_sources.load({"insecure_no_auth": True}).host == "0.0.0.0"


def test_compose_publishes_on_this_machine_only() -> None:
    ports = re.findall(r'^ +- "(.+:\d+)"$', (ROOT / "docker-compose.yml").read_text(), re.MULTILINE)
    assert len(ports) == 4
    assert all(port.startswith("127.0.0.1:") for port in ports)


@pytest.mark.parametrize(
    "target", ["help", "serve", "test", "lint", "proto", "lock", "matrix", "image-check", "clean"]
)
def test_make_knows_its_targets(target: str) -> None:
    plan = subprocess.run(
        ["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert plan.returncode == 0, plan.stderr
