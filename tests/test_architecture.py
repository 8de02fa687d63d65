"""The import rules of docs/architecture.md, and that a public name means one thing."""

import ast
import gc
import sys
from collections import defaultdict
from pathlib import Path

from tests.programs import run_program

ROOT = Path(__file__).parent.parent
WIRE = ROOT / "service/wayfarer/transport/schema"

TWINS = {
    "Agent", "AgentSpec", "Behaviour", "Block", "Bone", "Box", "Crowd", "Cylinder", "Endpoint",
    "Event", "FittedLength", "Floor", "Follow", "Goal", "KeepAway", "MotionChunks", "Part",
    "Patrol", "PoseFormat", "Prism", "Queue", "Ramp", "Routine", "Scene", "Session",
    "Stand", "Visit", "Walkable", "Wander",
}  # fmt: skip
"""Classes of the domain whose twin in transport/schema/ says the same as validated JSON."""


def test_imports_keep_to_the_rooms() -> None:
    run_program(Path(sys.executable).with_name("lint-imports"), "--no-cache", cwd=ROOT)


def public_classes() -> dict[str, list[Path]]:
    """Files that define each public class of the service and the lab."""
    gc.collect()  # Python 3.11 cannot parse while a coroutine of an earlier test is collected
    found = defaultdict(list)
    for package in (ROOT / "service", ROOT / "lab"):
        for path in sorted(package.rglob("*.py")):
            if "v1" in path.parts or path.is_symlink():  # a link: code of the Python client
                continue
            for node in ast.parse(path.read_text()).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    found[node.name].append(path)
    return found


def test_a_class_name_means_one_thing() -> None:
    twice = {
        name: [str(path.relative_to(ROOT)) for path in paths]
        for name, paths in public_classes().items()
        if len(paths) > 1 and not (name in TWINS and sum(WIRE in p.parents for p in paths) == 1)
    }
    assert not twice, f"public classes of one name that mean different things: {twice}"


def test_a_twin_has_one_class_in_the_domain_and_one_on_the_wire() -> None:
    classes = public_classes()
    assert {name for name in TWINS if len(classes[name]) != 2} == set()
