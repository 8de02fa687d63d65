"""The oldest supported protoc, and that of the PATH, make code of the protos for every language.

3.21 is what Debian 12 to 13 and Ubuntu 24.04 ship. It holds names against each other that newer
ones do not: fields whose JSON names are alike are refused.
"""

import shutil
import sys
from pathlib import Path

import grpc_tools
import protoc
import pytest
from google.protobuf import descriptor_pb2

from tests.programs import run_program

ROOT = Path(__file__).parents[2]
PROTO = ROOT / "proto"
SOURCES = sorted(f"wayfarer/v1/{path.name}" for path in (PROTO / "wayfarer" / "v1").glob("*.proto"))
STEMS = sorted(Path(source).stem for source in SOURCES)
OLDEST = str(protoc.PROTOC_EXE)
"""3.21, from the wheel of the same version; `libprotoc 21.11` and 3.21.11 are the same."""

WELL_KNOWN = Path(grpc_tools.__file__).parent / "_proto"
"""descriptor.proto, which options.proto imports: Debian has it in libprotobuf-dev."""

compilers = pytest.mark.parametrize(
    "compiler",
    [
        OLDEST,
        pytest.param(
            shutil.which("protoc") or "",
            marks=pytest.mark.skipif(not shutil.which("protoc"), reason="no protoc in the PATH"),
        ),
    ],
    ids=["oldest", "of the path"],
)


def compiled(compiler: str, out: Path, *options: str) -> list[str]:
    """Files that are made, relative to `out`."""
    done = run_program(compiler, f"-I{PROTO}", f"-I{WELL_KNOWN}", *options, *SOURCES)
    assert not done.stderr
    return sorted(str(path.relative_to(out)) for path in out.rglob("*") if path.is_file())


def test_the_oldest_is_of_3_21() -> None:
    assert run_program(OLDEST, "--version").stdout.split()[1].startswith(("21.", "3.21."))


@compilers
def test_python(compiler: str, tmp_path: Path) -> None:
    """Its output can be imported with the present protobuf."""
    made = compiled(compiler, tmp_path, f"--python_out={tmp_path}")
    assert made == [f"wayfarer/v1/{stem}_pb2.py" for stem in STEMS]
    for package in ("wayfarer", "wayfarer/v1"):
        (tmp_path / package / "__init__.py").touch()
    uses = (
        "; ".join(f"import wayfarer.v1.{stem}_pb2" for stem in STEMS),
        "g = wayfarer.v1.goal_pb2",
        f"assert g.__file__.startswith({str(tmp_path)!r}), g.__file__",
        "print(g.Goal.FromString(g.Goal(speed=1.5).SerializeToString()).speed)",
    )
    assert run_program(sys.executable, "-c", "; ".join(uses), cwd=tmp_path).stdout == "1.5\n"


@compilers
def test_cpp(compiler: str, tmp_path: Path) -> None:
    made = compiled(compiler, tmp_path, f"--cpp_out={tmp_path}")
    assert made == sorted(f"wayfarer/v1/{stem}.pb.{kind}" for stem in STEMS for kind in ("cc", "h"))


@compilers
def test_csharp(compiler: str, tmp_path: Path) -> None:
    made = compiled(compiler, tmp_path, f"--csharp_out={tmp_path}")
    assert made == [f"{stem.capitalize()}.cs" for stem in STEMS]
    assert "namespace Wayfarer.V1 {" in (tmp_path / "Goal.cs").read_text()


@compilers
def test_java(compiler: str, tmp_path: Path) -> None:
    made = compiled(compiler, tmp_path, f"--java_out={tmp_path}")
    assert {"wayfarer/v1/Goal.java", "wayfarer/v1/AgentSpec.java"} <= set(made)


@compilers
def test_every_file_has_the_same_options(compiler: str, tmp_path: Path) -> None:
    """Go's package above all: without it protoc-gen-go wants an option for every file."""
    image = tmp_path / "image.binpb"
    compiled(compiler, tmp_path, f"--descriptor_set_out={image}")
    found = {
        (
            file.options.go_package,
            file.options.java_package,
            file.options.java_multiple_files,
            file.options.csharp_namespace,
            file.options.objc_class_prefix,
        )
        for file in descriptor_pb2.FileDescriptorSet.FromString(image.read_bytes()).file
    }
    assert found == {("wayfarer/v1;wayfarerv1", "wayfarer.v1", True, "Wayfarer.V1", "WFR")}
