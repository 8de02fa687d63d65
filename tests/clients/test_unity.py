"""The Unity package: complete for Unity, and its code under mono."""

import json
import re
import shutil

import pytest

from tests.clients import unity_package as package

MISSING = [
    what
    for what, there in {
        "mono-mcs": shutil.which("mcs"),
        "nunit-console": shutil.which("nunit-console"),
        "libnunit-framework2.6.3-cil": package.LIBRARIES["nunit.framework.dll"].exists(),
        "libnewtonsoft-json5.0-cil": package.LIBRARIES["Newtonsoft.Json.dll"].exists(),
    }.items()
    if not there
]
with_mono = pytest.mark.skipif(
    bool(MISSING), reason=f"needs mono: apt-get install {' '.join(MISSING)}"
)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Folder of the compiled assemblies."""
    folder = tmp_path_factory.mktemp("unity")
    package.compile_all(folder)
    return folder


def test_every_asset_has_a_meta_file_and_no_meta_file_is_left_over():
    assets = package.assets()
    metas = {package.meta_of(asset) for asset in assets}
    assert metas == set(package.PACKAGE.rglob("*.meta")), "python -m tests.clients.unity_package"


def test_guids_are_valid_unique_and_those_of_the_list():
    found = {
        str(asset.relative_to(package.PACKAGE)): package.guid_of(package.meta_of(asset))
        for asset in package.assets()
    }
    assert all(re.fullmatch("[0-9a-f]{32}", guid) for guid in found.values())
    assert len(set(found.values())) == len(found)
    assert found == package.listed(), "a GUID may never change: see unity_package.py"


def test_the_manifest_is_what_upm_wants():
    manifest = json.loads((package.PACKAGE / "package.json").read_text())
    assert re.fullmatch(r"com(\.[a-z0-9-]+)+", manifest["name"])
    assert re.fullmatch(r"\d+\.\d+\.\d+", manifest["version"])
    assert f"## {manifest['version']}" in (package.PACKAGE / "CHANGELOG.md").read_text()
    for sample in manifest["samples"]:
        assert list((package.PACKAGE / sample["path"]).glob("*.cs")), sample
    for name in ("README.md", "LICENSE.md", "Documentation~"):
        assert (package.PACKAGE / name).exists()


def test_assemblies_refer_to_each_other_and_the_core_to_no_engine():
    found = {assembly.name: assembly for assembly in package.assemblies()}
    assert all(name == assembly.path.stem for name, assembly in found.items())
    assert found["Wayfarer.Core"].settings["noEngineReferences"]
    assert found["Wayfarer.Core"].settings["precompiledReferences"] == []
    sources = [source for assembly in found.values() for source in assembly.sources]
    scripts = {path for path in package.assets() if path.suffix == ".cs"}
    assert scripts <= set(sources), "scripts outside of all assemblies"
    assert len(set(sources)) == len(sources)


@with_mono
def test_its_own_tests_pass(built):
    """Golden vectors and traces, messages, stream, calls, and that nothing is allocated."""
    said = package.run(
        "nunit-console", "-nologo", "-noshadow", "-noresult", "Wayfarer.Tests.dll", cwd=built
    )
    counts = re.search(r"Tests run: (\d+), Errors: 0, Failures: 0, Inconclusive: 0", said)
    assert counts and int(counts[1]) > 120, said
    assert "Invalid: 0, Ignored: 0, Skipped: 0" in said, said


@with_mono
def test_an_agent_walks_to_its_goal_on_the_components(built, cluster):
    """On stub transforms: generic rigs, a Humanoid, and the sample's crowd.

    Through the entry of a cluster, a lost connection, and the drain of its node.
    """
    source = package.PACKAGE / "Tests~" / "Live" / "Live.cs"
    package.compile_program(source, built / "Live.exe")
    golden = package.PACKAGE.parents[1] / "tests" / "golden" / "retarget.json"
    with cluster.drained_meanwhile():
        said = package.run("mono", "Live.exe", cluster.url, str(golden), cwd=built)
    walked = [line.partition(":")[0] for line in said.splitlines() if ": walked to " in line]
    assert walked == ["unity", "a_pose", "centimetres", "vrm1"]
    assert "crowd: 5 people walk about" in said
