"""Build hook of the client: the repository's, on `proto/` there or in the sdist."""

import importlib.util
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
SHARED = "proto/build_hook.py"


def get_build_hook() -> Any:
    """Called by hatch."""
    found = [path for path in (HERE / SHARED, HERE.parents[1] / SHARED) if path.is_file()]
    if not found:
        raise FileNotFoundError(f"{SHARED} is neither in {HERE} nor in {HERE.parents[1]}")
    spec = importlib.util.spec_from_file_location("wayfarer_proto_build_hook", found[0])
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.ProtoBuildHook
