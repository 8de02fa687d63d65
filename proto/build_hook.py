"""Hatch build hook: generate the Python code of the wire contract from `proto/`.

Used by the server (`service/wayfarer/v1`) and by the Python client
(`clients/python/wayfarer_client/v1`). The result is built, never committed.
"""

import importlib.util
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PROTO = Path(__file__).resolve().parent


def generate(package_root: Path, package: str) -> None:
    """Write `<package_root>/<package>/v1/*_pb2*.py`, importable as `<package>.v1`.

    Beside them stand what restates the protos: for the server the classes of transport/schema, for
    the client the fields of a goal as keyword arguments.
    """
    import grpc_tools
    from grpc_tools import protoc

    sources = sorted((PROTO / "wayfarer" / "v1").glob("*.proto"))
    if not sources:
        raise RuntimeError(f"there are no .proto files in {PROTO / 'wayfarer' / 'v1'}")
    well_known = Path(grpc_tools.__file__).parent / "_proto"
    target = package_root / package / "v1"
    target.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as staging:
        outputs = [f"--{kind}_out={staging}" for kind in ("python", "pyi", "grpc_python")]
        described = Path(staging) / "described.binpb"
        outputs += [f"--descriptor_set_out={described}", "--include_imports"]
        outputs += ["--include_source_info"]
        code = protoc.main(
            ["protoc", f"-I{PROTO}", f"-I{well_known}", *outputs, *map(str, sources)]
        )
        if code != 0:
            raise RuntimeError(f"protoc failed with code {code} on {[s.name for s in sources]}")
        for made in sorted((Path(staging) / "wayfarer" / "v1").iterdir()):
            text = made.read_text(encoding="utf-8")
            text = text.replace("from wayfarer.v1 import", f"from {package}.v1 import")
            (target / made.name).write_text(text, encoding="utf-8")
        classes = _schema_classes()
        files = classes.FileDescriptorSet.FromString(described.read_bytes())
        if package == "wayfarer":
            made = package_root / package / "transport" / "schema" / "messages.py"
            made.write_text(classes.Classes(files).module(), encoding="utf-8")
        else:
            (target / "fields.py").write_text(classes.goal_fields(files), encoding="utf-8")
    (target / "__init__.py").write_text('"""Generated from proto/wayfarer/v1."""\n')


def _schema_classes() -> Any:
    """The module `schema_classes.py` beside this file."""
    spec = importlib.util.spec_from_file_location(
        "wayfarer_schema_classes", PROTO / "schema_classes.py"
    )
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class ProtoBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Generates before every build, editable installs included."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called by hatch; `self.config` may name another root and package."""
        root = Path(self.root) / self.config.get("package-root", "service")
        generate(root, self.config.get("package", "wayfarer"))
