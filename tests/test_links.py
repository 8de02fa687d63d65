"""Links, anchors and file paths of all Markdown pages lead somewhere."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
CODE = [
    "/" + str(file.relative_to(ROOT))
    for folder in (
        "service",
        "lab",
        "clients/python",
        "tests",
        "benchmarks",
    )
    for file in (ROOT / folder).rglob("*.*")
    if not {"node_modules", "__pycache__"} & set(file.parts)
]

PAGES = [
    str(page.relative_to(ROOT))
    for pattern in (
        "*.md",
        "docs/*.md",
        "benchmarks/results/*.md",
        "clients/*.md",
        "clients/*/*.md",
        "lab/**/*.md",
        "tests/golden/*.md",
    )
    for page in sorted(ROOT.glob(pattern))
    if not {"node_modules", ".venv"} & set(page.parts)
]


def prose(page: Path) -> str:
    return re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)


def anchors(page: Path) -> set[str]:
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ +(.*)$", prose(page), re.MULTILINE)
    texts = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading) for heading in headings]
    return {re.sub(r"[^\w\- ]", "", text.lower()).strip().replace(" ", "-") for text in texts}


def leads_somewhere(page: Path, link: str) -> bool:
    path, _, anchor = link.partition("#")
    target = page.parent / path if path else page
    return target.exists() and (not anchor or anchor in anchors(target))


def exists(path: str) -> bool:
    """Pages shorten paths: `stepping/mirror.py`."""
    return (ROOT / path).exists() or any(file.endswith("/" + path) for file in CODE)


def test_a_dead_link_or_anchor_is_found():
    page = ROOT / "README.md"
    assert leads_somewhere(page, "docs/operations.md#who-may-call")
    assert not leads_somewhere(page, "docs/operations.md#no-such-heading")
    assert not leads_somewhere(page, "docs/no_such_page.md")
    assert exists("wayfarer/spec.py") and not exists("wayfarer/no_such.py")


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_somewhere(name: str):
    page = ROOT / name
    links = re.findall(r"\]\((?!\w+:)([^)\s]+)\)", prose(page))
    assert [link for link in links if not leads_somewhere(page, link)] == []


@pytest.mark.parametrize("name", PAGES)
def test_files_that_are_named_exist(name: str):
    page = ROOT / name
    named = re.findall(r"`([\w.-]+(?:/[\w.-]+)+\.(?:py|proto|md|toml|js|yml|yaml))`", prose(page))
    named += re.findall(r"(?<![\w/(.\[-])(docs/[\w-]+\.md)", prose(page))
    assert [path for path in named if not exists(path)] == []
