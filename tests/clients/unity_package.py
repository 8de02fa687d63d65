"""The Unity package: metadata of its files for Unity, and its assemblies.

`python -m tests.clients.unity_package` writes the .meta files of new files, and notes their GUIDs
in unity_guids.txt. Users' scenes refer to scripts by GUID: it never changes one. Move a .meta file
along with its file, and change the path in the list.
"""

import json
import shutil
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.programs import run_program

PACKAGE = Path(__file__).parents[2] / "clients" / "unity"
LIST = Path(__file__).parent / "unity_guids.txt"
STUBS = PACKAGE / "Tests~" / "Stubs"
LIBRARIES = {
    "Newtonsoft.Json.dll": Path("/usr/lib/cli/Newtonsoft.Json-5.0/Newtonsoft.Json.dll"),
    "nunit.framework.dll": Path("/usr/lib/cli/nunit.framework-2.6.3/nunit.framework.dll"),
}
OF_UNITY = ("UnityEngine.TestRunner", "UnityEditor.TestRunner")

IMPORTERS = {
    ".cs": "MonoImporter:\n  externalObjects: {}\n  serializedVersion: 2\n  defaultReferences: []\n"
    "  executionOrder: 0\n  icon: {instanceID: 0}\n",
    ".asmdef": "AssemblyDefinitionImporter:\n  externalObjects: {}\n",
    ".md": "TextScriptImporter:\n  externalObjects: {}\n",
    "package.json": "PackageManifestImporter:\n  externalObjects: {}\n",
    "folder": "folderAsset: yes\nDefaultImporter:\n  externalObjects: {}\n",
}
LABELS = "  userData: \n  assetBundleName: \n  assetBundleVariant: \n"


def assets() -> list[Path]:
    """Files and folders that Unity imports: not hidden, and in no folder whose name ends with ~."""
    return [
        path
        for path in sorted(PACKAGE.rglob("*"))
        if path.suffix != ".meta"
        and not any(
            part.startswith(".") or part.endswith("~") for part in path.relative_to(PACKAGE).parts
        )
    ]


def meta_of(asset: Path) -> Path:
    return asset.with_name(asset.name + ".meta")


def guid_of(meta: Path) -> str:
    lines = meta.read_text().splitlines()
    assert lines[0] == "fileFormatVersion: 2", meta
    name, _, guid = lines[1].partition(": ")
    assert name == "guid", meta
    return guid


def listed() -> dict[str, str]:
    """Path of an asset → its permanent GUID."""
    rows = (line.split(maxsplit=1) for line in LIST.read_text().splitlines())
    return {path: guid for guid, path in rows}


def write_metas() -> None:
    """Write .meta files for assets without one."""
    guids = listed() if LIST.exists() else {}
    for asset in assets():
        name = str(asset.relative_to(PACKAGE))
        if not meta_of(asset).exists():
            kind = "folder" if asset.is_dir() else asset.suffix
            importer = IMPORTERS["package.json" if name == "package.json" else kind]
            guid = guids.get(name, uuid.uuid4().hex)
            meta_of(asset).write_text(f"fileFormatVersion: 2\nguid: {guid}\n{importer}{LABELS}")
        guids.setdefault(name, guid_of(meta_of(asset)))
    LIST.write_text("".join(f"{guid} {name}\n" for name, guid in sorted(guids.items())))


@dataclass(frozen=True)
class Assembly:
    """An .asmdef, and the scripts of its folder."""

    path: Path
    settings: dict[str, Any]

    @property
    def name(self) -> str:
        return str(self.settings["name"])

    @property
    def sources(self) -> list[Path]:
        nested = [
            other.parent
            for other in self.path.parent.rglob("*.asmdef")
            if other.parent != self.path.parent
        ]
        return [
            source
            for source in sorted(self.path.parent.rglob("*.cs"))
            if not any(folder in source.parents for folder in nested)
        ]


def assemblies() -> list[Assembly]:
    """Assemblies of the package and its samples, each after its references."""
    left = [Assembly(path, json.loads(path.read_text())) for path in PACKAGE.rglob("*.asmdef")]
    found: list[Assembly] = []
    while left:
        known = {*OF_UNITY, *(assembly.name for assembly in found)}
        ready = [each for each in left if known.issuperset(each.settings["references"])]
        assert ready, f"references that lead nowhere: {[each.name for each in left]}"
        found += ready
        left = [each for each in left if each not in ready]
    return found


def compile_all(into: Path) -> None:
    """The assemblies, as Unity does: each sees only what its .asmdef names.

    AssertionError, with what the compiler said, when one does not compile.
    """
    _compile([STUBS / "UnityEngine.cs"], into / "UnityEngine.dll", [])
    _compile([STUBS / "UnityEditor.cs"], into / "UnityEditor.dll", [into / "UnityEngine.dll"])
    for assembly in assemblies():
        settings = assembly.settings
        references = [
            into / f"{name}.dll" for name in settings["references"] if name not in OF_UNITY
        ]
        for library in settings["precompiledReferences"]:
            shutil.copy(LIBRARIES[library], into)
            references.append(into / library)
        if not settings["noEngineReferences"]:
            references.append(into / "UnityEngine.dll")
        if settings["includePlatforms"] == ["Editor"]:
            references.append(into / "UnityEditor.dll")
        _compile(assembly.sources, into / f"{assembly.name}.dll", references)


def compile_program(source: Path, into: Path) -> None:
    """A program that uses all assemblies in its folder."""
    _compile([source], into, sorted(into.parent.glob("*.dll")), target="exe")


def _compile(
    sources: list[Path], into: Path, references: list[Path], target: str = "library"
) -> None:
    run(
        "mcs",
        f"-target:{target}",
        "-warnaserror",
        "-r:System.Net.Http.dll",  # Unity's compiler sees all of .NET Standard
        f"-out:{into}",
        *(f"-r:{reference}" for reference in references),
        *map(str, sources),
    )


def run(*command: str, cwd: Path = PACKAGE) -> str:
    return run_program(*command, cwd=cwd).stdout


if __name__ == "__main__":
    write_metas()
