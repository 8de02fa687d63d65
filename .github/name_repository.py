"""Names the repository in what is released, which reads the same in every clone until then.

python .github/name_repository.py https://HOST/OWNER/NAME TAG

Links from the packages' READMEs to other files become absolute, and the packages' metadata says
where source, issues and changelog are. It changes the working tree: for a throw-away checkout.
"""

import json
import re
import sys
from pathlib import Path
from posixpath import normpath

READMES = ("README.md", "clients/python/README.md", "clients/web/README.md")
PROJECTS = ("pyproject.toml", "clients/python/pyproject.toml")
RELATIVE = re.compile(r"\]\((?!#|[a-z]+:)([^)#\s]+)((?:#[^)]*)?)\)")
IMAGE = re.compile(r"!\[([^]]*)\]\((?![a-z]+:)([^)\s]+)\)")


def absolute(text: str, folder: str, url: str, tag: str) -> str:
    """A README of `folder` ("" is the root) in which every link names the repository."""

    def place(path: str) -> str:
        return normpath(f"{folder}/{path}".lstrip("/"))

    text = IMAGE.sub(lambda m: f"![{m[1]}]({url}/raw/{tag}/{place(m[2])})", text)
    return RELATIVE.sub(lambda m: f"]({url}/blob/{tag}/{place(m[1])}{m[2]})", text)


def main(root: Path, url: str, tag: str) -> None:
    """Raises OSError."""
    for name in READMES:
        file = root / name
        file.write_text(absolute(file.read_text(), str(Path(name).parent), url, tag))
    urls = f"""
[project.urls]
Source = "{url}"
Issues = "{url}/issues"
Changelog = "{url}/blob/{tag}/CHANGELOG.md"
"""
    for name in PROJECTS:
        with (root / name).open("a") as file:
            file.write(urls)
    web = root / "clients/web/package.json"
    known = json.loads(web.read_text())
    known["repository"] = {"type": "git", "url": f"git+{url}.git", "directory": "clients/web"}
    known |= {"homepage": url, "bugs": f"{url}/issues"}
    web.write_text(json.dumps(known, indent=2) + "\n")


if __name__ == "__main__":
    main(Path.cwd(), *sys.argv[1:])
