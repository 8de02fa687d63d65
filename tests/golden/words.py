"""Words of bone names (the Python client's bone_names.json) in the languages of other clients."""

import json
from pathlib import Path
from typing import Any

from wayfarer_client.bones_by_name import WORDS

CLIENTS = Path(__file__).parents[2] / "clients"
MADE = "// Written by `python -m tests.golden` from the Python client's bone_names.json.\n"


def files() -> dict[Path, bytes]:
    """Path → content."""
    words = {key: value for key, value in WORDS.items() if key != "about"}
    javascript = f"{MADE}\nexport const WORDS = {json.dumps(words, indent=1)};\n"
    return {
        CLIENTS / "web" / "src" / "core" / "bone_names.js": javascript.encode(),
        CLIENTS / "unity" / "Runtime" / "Core" / "BoneNames.cs": sharp(words).encode(),
        CLIENTS / "cpp" / "src" / "bone_names.hpp": header(words).encode(),
        CLIENTS / "godot/addons/wayfarer/core/bone_names.gd": godot(words).encode(),
    }


def sharp(words: dict[str, Any]) -> str:
    """A class in C#."""
    roles = {role: f"new[] {_listed(values)}" for role, values in words["roles"].items()}
    vrm = {bone: json.dumps(name) for bone, name in words["vrm"].items() if bone != "spine"}
    fields = [
        ("Roles", "Dictionary<string, string[]>", _table(roles)),
        *(
            (key.capitalize(), "HashSet<string>", f"            {_listed(words[key])}")
            for key in ("left", "right", "noise", "helpers")
        ),
        ("Vrm", "Dictionary<string, string>", _table(vrm)),
        ("VrmSpine", "string[]", f"            {_listed(words['vrm']['spine'])}"),
    ]
    body = "\n".join(
        f"        internal static readonly {kind} {name} = new {kind}\n{value};\n"
        for name, kind, value in fields
    )
    return (
        f"{MADE}using System.Collections.Generic;\n\nnamespace Wayfarer\n{{\n"
        f"    internal static class BoneNames\n    {{\n{body}    }}\n}}\n"
    )


def header(words: dict[str, Any]) -> str:
    """Arrays of words or of pairs in C++."""
    vrm = {bone: name for bone, name in words["vrm"].items() if bone != "spine"}
    lists = {f"role_{role}": values for role, values in words["roles"].items()}
    lists |= {key: words[key] for key in ("left", "right", "noise", "helpers")}
    lists |= {"vrm_spine": words["vrm"]["spine"]}
    arrays = {name: [f'"{value}"sv' for value in values] for name, values in lists.items()}
    arrays["vrm"] = [f'std::pair{{"{bone}"sv, "{name}"sv}}' for bone, name in vrm.items()]
    includes = "".join(f"#include <{name}>\n" for name in ("array", "string_view", "utility"))
    body = "".join(
        f"inline constexpr std::array {name}{{\n    {', '.join(values)}}};\n"
        for name, values in arrays.items()
    )
    return (
        f"{MADE}#pragma once\n\n{includes}\nnamespace wayfarer::words {{\n"
        f"using namespace std::string_view_literals;\n\n{body}\n}}  // namespace wayfarer::words\n"
    )


def godot(words: dict[str, Any]) -> str:
    """A class in GDScript."""
    vrm = dict(words["vrm"])
    tables = {
        "ROLES": words["roles"],
        **{key.upper(): words[key] for key in ("left", "right", "noise", "helpers")},
        "VRM_SPINE": vrm.pop("spine"),
        "VRM": vrm,
    }
    fields = "".join(
        f"const {name} := " + json.dumps(values, indent="\t") + "\n"
        for name, values in tables.items()
    )
    return f"class_name WayfarerBoneNames\nextends RefCounted\n{MADE.replace('//', '##')}\n{fields}"


def _listed(values: list[str]) -> str:
    return "{ " + ", ".join(map(json.dumps, values)) + " }"


def _table(entries: dict[str, str]) -> str:
    rows = "".join(
        f"                [{json.dumps(key)}] = {each},\n" for key, each in entries.items()
    )
    return f"            {{\n{rows}            }}"
