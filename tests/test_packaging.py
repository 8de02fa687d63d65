"""Files of the project that no interpreter reads before they are needed: do they fit together?"""

import json
import re
import runpy
import shutil
import tomllib
from pathlib import Path

import pytest
import yaml

from tests.programs import run_program
from wayfarer import __version__
from wayfarer.config import sources

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
    assert variables and sources.load({"insecure_no_auth": True}).host == "0.0.0.0"


def test_compose_publishes_on_this_machine_only() -> None:
    ports = re.findall(r'^ +- "(.+:\d+)"$', (ROOT / "docker-compose.yml").read_text(), re.MULTILINE)
    assert len(ports) == 4
    assert all(port.startswith("127.0.0.1:") for port in ports)


@pytest.mark.parametrize(
    "target", ["help", "serve", "test", "lint", "proto", "lock", "matrix", "image-check", "clean"]
)
def test_make_knows_its_targets(target: str) -> None:
    run_program("make", "--dry-run", target, cwd=ROOT)


@pytest.mark.parametrize(
    ("file", "stated"),
    [
        ("clients/python/pyproject.toml", r'^version = "(.+)"'),
        ("lab/pyproject.toml", r'^version = "(.+)"'),
        ("clients/web/package.json", r'^  "version": "(.+)"'),
        ("clients/web/package-lock.json", r'^  "version": "(.+)"'),
        ("clients/unity/package.json", r'^  "version": "(.+)"'),
        ("clients/godot/addons/wayfarer/plugin.cfg", r'^version="(.+)"'),
        ("clients/unreal/Wayfarer.uplugin", r'"VersionName": "(.+)"'),
        ("clients/cpp/CMakeLists.txt", r"^project\(wayfarer VERSION (\S+)"),
        ("clients/cpp/src/wayfarer_c.cpp", r'wf_version\(\) { return "(.+)"; }'),
        ("CHANGELOG.md", r"^## \[(\d.+)\]"),
        ("clients/unity/CHANGELOG.md", r"^## (\d\S+)"),
    ],
)
def test_every_package_has_the_version_of_the_service(file: str, stated: str) -> None:
    found = re.search(stated, (ROOT / file).read_text(), re.MULTILINE)
    assert found is not None and found[1] == __version__


def test_a_release_names_its_repository(tmp_path: Path) -> None:
    script = runpy.run_path(str(ROOT / ".github/name_repository.py"))
    for name in (*script["READMES"], *script["PROJECTS"], "clients/web/package.json"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    script["main"](tmp_path, "https://example.org/us/wayfarer", "v1")
    for name in script["READMES"]:
        text = (tmp_path / name).read_text()
        assert re.findall(r"\]\((?!https?://|#)[^)]*\)", text) == []
        for path in re.findall(r"example\.org/us/wayfarer/(?:blob|raw)/v1/([^)#]+)", text):
            assert (ROOT / path).exists(), path
    for name in script["PROJECTS"]:
        urls = tomllib.loads((tmp_path / name).read_text())["project"]["urls"]
        assert urls["Source"] == "https://example.org/us/wayfarer"
    web = json.loads((tmp_path / "clients/web/package.json").read_text())
    assert web["repository"]["directory"] == "clients/web"


def test_the_release_workflow_runs_what_is_there() -> None:
    steps = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())["jobs"]["packages"]
    commands = "\n".join(step.get("run", "") for step in steps["steps"])
    for path in re.findall(r"\.github/\S+\.py|clients/\w+", commands):
        assert (ROOT / path).exists()
    for target in re.findall(r"\bmake (\S+)", commands):
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), re.MULTILINE)
