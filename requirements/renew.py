"""`make lock`: choose again the versions that are installed, from what the packages allow.

    build.txt   what builds the packages of this repository      with hashes
    serve.txt   what the service needs: `make serve`, the image   with hashes
    dev.txt     those and all extras, tests, lab and client       constraints, without hashes: torch
                                                                  comes in builds of many kinds

Each holds for all Pythons and platforms that the packages name (markers tell them apart). The
newest versions are taken; `--keep` takes as few new ones as changed needs allow.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import venv
from itertools import chain
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parent
PACKAGES = tuple(ROOT / name for name in (".", "lab", "clients/python"))
RESOLVER = "uv>=0.9,<1"
HEADER = "# made by `make lock`; the ranges that it chooses from are in pyproject.toml\n"


def main() -> None:
    """Write the three files, or end with what the resolver said."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--keep", action="store_true", help="change as little as the needs allow")
    keep = parser.parse_args().keep
    projects = [tomllib.loads((path / "pyproject.toml").read_text()) for path in PACKAGES]
    own = {project["project"]["name"] for project in projects}
    oldest = re.sub("[^0-9.]", "", projects[0]["project"]["requires-python"])
    needs = {
        # hatchling names `editables` only when it makes an editable install
        "build": [need for p in projects for need in p["build-system"]["requires"]] + ["editables"],
        "serve": projects[0]["project"]["dependencies"],
        "dev": [need for p in projects for need in all_needs(p["project"])],
    }
    needs["dev"] += needs["build"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        venv.create(folder, with_pip=True)
        subprocess.run([folder / "bin/pip", "install", "--quiet", RESOLVER], check=True)
        if keep:
            shutil.copy(HERE / "dev.txt", folder)  # what it finds there it prefers
        hashed = ["--generate-hashes", f"--constraint={folder}/dev.txt"]
        for kind, options in (("dev", []), ("serve", hashed), ("build", hashed)):
            wanted = [need for need in needs[kind] if name_of(need) not in own]
            (folder / f"{kind}.in").write_text("\n".join(wanted))
            command = [folder / "bin/uv", "pip", "compile", "--quiet", "--universal", "--no-header"]
            command += [f"--python-version={oldest}", "--no-annotate", *options]
            command += [f"--output-file={folder / kind}.txt", folder / f"{kind}.in"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        for kind in needs:
            text = (folder / f"{kind}.txt").read_text()
            (HERE / f"{kind}.txt").write_text(HEADER + text)
            print(f"requirements/{kind}.txt: {len(pins(text))} pins", file=sys.stderr)


def all_needs(project: dict[str, Any]) -> list[str]:
    """All needs of a package, those of its extras included."""
    extras = project.get("optional-dependencies", {}).values()
    return [*project["dependencies"], *chain.from_iterable(extras)]


def name_of(need: str) -> str:
    """The package that a requirement names."""
    return re.split(r"[\s\[<>=!~;]", need, maxsplit=1)[0].lower()


def pins(text: str) -> list[str]:
    """The lines `name==version` of a file."""
    return re.findall(r"^[A-Za-z0-9].*==.*$", text, re.MULTILINE)


if __name__ == "__main__":
    main()
