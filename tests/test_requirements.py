"""The pinned versions of requirements/ are those of pyproject.toml; `make lock` renews them."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
PROJECTS = {
    name: tomllib.loads((ROOT / name / "pyproject.toml").read_text())
    for name in (".", "lab", "clients/python")
}
OWN = {project["project"]["name"] for project in PROJECTS.values()}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
PLATFORMS = (("linux", "x86_64"), ("linux", "aarch64"), ("darwin", "arm64"), ("win32", "AMD64"))


def environment(python: str, system: str = "linux", machine: str = "x86_64") -> dict[str, str]:
    return {
        "python_version": python,
        "python_full_version": f"{python}.1",
        "sys_platform": system,
        "platform_system": {"linux": "Linux", "darwin": "Darwin", "win32": "Windows"}[system],
        "platform_machine": machine,
    }


def pins(file: str, where: dict[str, str]) -> dict[str, str]:
    """Name → version for one Python and platform; one version each."""
    found: dict[str, str] = {}
    for line in re.findall(r"^\w.*$", (ROOT / "requirements" / file).read_text(), re.MULTILINE):
        pin = Requirement(line.rstrip(" \\"))
        if pin.marker is None or pin.marker.evaluate(where):
            ((operator, version),) = ((each.operator, each.version) for each in pin.specifier)
            assert operator == "==" and canonicalize_name(pin.name) not in found
            found[canonicalize_name(pin.name)] = version
    return found


def unmet(needs: list[str], pinned: dict[str, str], where: dict[str, str]) -> list[str]:
    """Requirements that the pins leave out, or pin outside of the range."""
    wanted = [Requirement(need) for need in needs]
    return [
        str(need)
        for need in wanted
        if need.name not in OWN
        and (need.marker is None or need.marker.evaluate({**where, "extra": ""}))
        and pinned.get(canonicalize_name(need.name), "none") not in need.specifier
    ]


@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize(("system", "machine"), PLATFORMS)
def test_what_the_service_needs_is_pinned_within_its_range(python, system, machine):
    where = environment(python, system, machine)
    needs = PROJECTS["."]["project"]["dependencies"]
    assert unmet(needs, pins("serve.txt", where), where) == []


@pytest.mark.parametrize("python", PYTHONS)
def test_what_builds_the_packages_is_pinned_within_its_range(python):
    where = environment(python)
    needs = [need for project in PROJECTS.values() for need in project["build-system"]["requires"]]
    assert unmet(needs, pins("build.txt", where), where) == []


@pytest.mark.parametrize("python", PYTHONS)
def test_everything_else_is_constrained_to_the_same_versions(python):
    where = environment(python)
    everything = pins("dev.txt", where)
    for project in PROJECTS.values():
        extras = project["project"].get("optional-dependencies", {}).values()
        needs = sum(extras, project["project"]["dependencies"])
        assert unmet(needs, everything, where) == []
    for file in ("serve.txt", "build.txt"):
        assert pins(file, where).items() <= everything.items()


@pytest.mark.parametrize("file", ["serve.txt", "build.txt"])
def test_what_is_installed_for_users_is_known_by_its_hash(file):
    text = (ROOT / "requirements" / file).read_text()
    found = re.findall(r"^\w\S*==.*(?:\\\n +--hash=sha256:[0-9a-f]{64} ?)+$", text, re.MULTILINE)
    assert len(found) == len(re.findall(r"^\w", text, re.MULTILINE)) > 0


def test_no_package_of_ours_is_taken_from_elsewhere():
    """Another project has the name wayfarer on PyPI."""
    for file in ("serve.txt", "build.txt", "dev.txt"):
        assert OWN.isdisjoint(pins(file, environment("3.13")))
    lab = map(Requirement, PROJECTS["lab"]["project"]["dependencies"])
    (wanted,) = (need for need in lab if need.name == "wayfarer")
    assert "0.2.0" in wanted.specifier and "0.8" not in wanted.specifier
