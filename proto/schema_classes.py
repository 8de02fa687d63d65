"""Writes the JSON forms of messages as pydantic classes: types, ranges, defaults, descriptions; and
a goal's fields as types of keyword arguments.

Fields and options come from the descriptors; comments of the protos become the descriptions.
"""

import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FileDescriptorSet

SCHEMA: Final = "wayfarer.transport.schema"
BY_HAND: Final = {
    name: module
    for module, names in {
        f"{SCHEMA}.base": "Gender MeshFormat Vector3",
        "wayfarer.clips.files": "BodyDetail BoneNames FileFormat FileUnit RootMotion",
        "wayfarer.config.limits": "Limits",
        "wayfarer.runtime.streams.publications": "SlowReader",
        "wayfarer.transport.codec": "PoseEncoding PoseProfile",
        "wayfarer.transport.conversion.basis": "Basis",
        "wayfarer.world.agents.agent": "AgentState",
        "wayfarer.world.events": "EventKind",
        "": "Heartbeat Problem",  # in no message that is generated
    }.items()
    for name in names.split()
}
"""Classes that are written by hand, and their modules."""

TYPES_BY_HAND: Final = {
    "AgentSpec.betas": "Betas",
    "Box.size": "Extents",
    "CharacterJoint.bone": "PosedBone",
    "LoadModelRequest.name": "ModelName",
    "PoseFormat.bones": "Bones",
    "PoseFormat.fps": "Rate",
    "Ramp.size": "Extents",
}
BASES: Final = {"AgentSpec": "OneBody"}
"""What `options.proto` cannot state stands in `base`: types of fields, checks of several fields."""

IN_QUERY: Final = {"expected_revision"}
"""Fields that HTTP has in the query of a call, not in its body."""

WIDTH: Final = 100
FULL: Final = "wayfarer.v1."
Field: Final = descriptor_pb2.FieldDescriptorProto
TYPES: Final = {
    Field.TYPE_DOUBLE: "float",
    Field.TYPE_FLOAT: "float",
    Field.TYPE_BOOL: "bool",
    Field.TYPE_STRING: "str",
    Field.TYPE_BYTES: "str",
}
"""All others are integers."""

STRICT: Final = {"float": "Float", "int": "Uint32", "bool": "Bool"}
"""Types of requests; answers, which the server makes, have plain ones."""

QUANTITIES: Final = {1: "Length", 2: "Heading", 3: "Spot", 4: "Float", 6: "Float"}
RANGES: Final = {1: "length_range", 4: "plain_range", 5: "count_range", 6: "plain_range"}
"""By `FieldRules.Unit`."""


class Classes:
    """The classes of a set of protos, which has its imports and comments."""

    def __init__(self, files: FileDescriptorSet) -> None:
        self._pool = descriptor_pool.DescriptorPool()
        for file in files.file:
            self._pool.Add(file)
        ours = [file for file in files.file if file.name.startswith("wayfarer/")]
        self._all = {kind.name: kind for file in ours for kind in file.message_type}
        self._comments = {name: text for file in ours for name, text in _comments(file)}
        self._in_path: dict[str, set[str]] = {}
        self._asked: set[str] = set()
        for method in (m for file in ours for service in file.service for m in service.method):
            call = self._options("MethodOptions", method, "call")
            name = method.input_type.removeprefix(f".{FULL}")
            self._in_path[name] = set(re.findall(r"{(\w+)}", call.route))
            self._reach(name)
        self._made = [
            kind
            for file in ours
            if Path(file.name).stem not in ("control", "options")
            for kind in file.message_type
            if self.name(kind) and kind.name not in BY_HAND
        ]
        self._used: set[tuple[str, str]] = set()

    def module(self) -> str:
        """The text of a module."""
        text = "".join(f"\n\n{self._class(kind)}" for kind in self._in_order())
        head = '"""Messages, generated from proto/wayfarer/v1 by proto/schema_classes.py."""\n\n'
        return f"{head}{self._imports()}{text}"

    def name(self, kind: descriptor_pb2.DescriptorProto) -> str:
        """Name of its class; empty: it has none."""
        named: str = self._options("MessageOptions", kind, "message").name
        return named or ("" if re.search("(Request|Response)$", kind.name) else kind.name)

    def _options(self, kind: str, item: Any, extension: str) -> Any:
        found = self._pool.FindMessageTypeByName(f"google.protobuf.{kind}")
        options = message_factory.GetMessageClass(found)
        text = item.options.SerializeToString()
        return options.FromString(text).Extensions[self._pool.FindExtensionByName(FULL + extension)]

    def _reach(self, name: str) -> None:
        """`name` and what it holds come in requests."""
        if name not in self._asked:
            self._asked.add(name)
            for field in self._all[name].field:
                if field.type == Field.TYPE_MESSAGE and _short(field) in self._all:
                    self._reach(_short(field))

    def _in_order(self) -> list[descriptor_pb2.DescriptorProto]:
        """The messages, each after those that it holds."""
        made = {kind.name: kind for kind in self._made}
        found: dict[str, descriptor_pb2.DescriptorProto] = {}

        def add(kind: descriptor_pb2.DescriptorProto) -> None:
            for field in kind.field:
                if _short(field) in made and _short(field) != kind.name:
                    add(made[_short(field)])
            found.setdefault(kind.name, kind)

        for kind in self._made:
            add(kind)
        return list(found.values())

    def _use(self, name: str, module: str = f"{SCHEMA}.base") -> str:
        self._used.add((module, name))
        return name

    def _imports(self) -> str:
        modules: dict[str, list[str]] = {}
        for module, name in sorted(self._used, key=lambda use: (use[0], use[1][0].islower(), use)):
            modules.setdefault(module, []).append(name)
        groups: dict[int, list[str]] = {0: [], 1: [], 2: []}
        for module, names in modules.items():
            line = f"from {module} import {', '.join(names)}"
            if len(line) > WIDTH:
                line = f"from {module} import (\n    " + ",\n    ".join(names) + ",\n)"
            groups[{"typing": 0, "pydantic": 1}.get(module, 2)].append(line)
        return "\n\n".join("\n".join(group) for group in groups.values()) + "\n"

    def _class(self, kind: descriptor_pb2.DescriptorProto) -> str:
        name = self.name(kind)
        asked = kind.name in self._asked
        base = self._use(BASES.get(name) or ("OneOf" if _oneof(kind) else "Message"))
        parts = [_docstring(self._comments[kind.name])]
        if example := self._options("MessageOptions", kind, "message").example:
            parts.append(_call(f"    model_config = {self._use('example')}", [("", example)]))
        left_out = self._in_path.get(kind.name, set()) | IN_QUERY
        fields = [self._field(f, kind, asked) for f in kind.field if f.name not in left_out]
        if fields:
            parts.append("".join(fields))
        return f"class {name}({base}):\n" + "\n".join(parts)

    def _field(self, field: Any, message: Any, asked: bool) -> str:
        full = f"{message.name}.{field.name}"
        rules = self._options("FieldOptions", field, "field")
        kind, is_list = self._type(field, rules, asked)
        kind = self._use(TYPES_BY_HAND[full]) if full in TYPES_BY_HAND else kind
        in_oneof = field.HasField("oneof_index") and not field.proto3_optional
        at_least_one = rules.min > 0 and (is_list or kind == "str")
        required = rules.required if rules.HasField("required") else at_least_one or not asked
        stated = rules.HasField("min") or rules.HasField("max")
        arguments = []
        if in_oneof or not required:
            default = self._default(field, rules, kind, is_list)
            if default == "None":
                kind += " | None"
            arguments.append(f"default={default}")
        if asked and rules.unit in RANGES and not stated:
            self._use("Annotated", "typing")
            names = f"{_literal(self.name(message))}, {_literal(field.name)}"
            kind = f"Annotated[{kind}, {self._use(RANGES[rules.unit])}({names})]"
        arguments += self._limits(rules, is_list or field.type == Field.TYPE_STRING)
        arguments.append(("description=", self._comments[full]))
        self._use("Field", "pydantic")
        return _call(f"    {field.name}: {kind} = Field", arguments)

    def _type(self, field: Any, rules: Any, asked: bool) -> tuple[str, bool]:
        is_list = field.label == Field.LABEL_REPEATED
        if field.type in (Field.TYPE_MESSAGE, Field.TYPE_ENUM):
            kind = _short(field)
            if kind in BY_HAND:
                self._use(kind, BY_HAND[kind])
            elif field.type == Field.TYPE_MESSAGE:
                kind = self.name(self._all[kind])
            if kind == "Vector3" and rules.unit:
                kind = self._use(QUANTITIES[rules.unit])
        elif rules.unit in QUANTITIES and asked:
            kind = self._use(QUANTITIES[rules.unit])
        else:
            kind = TYPES.get(field.type, "int")
            if asked and kind in STRICT:
                kind = self._use(STRICT[kind])
            elif rules.line and asked:
                kind = self._use("Text")
        if is_list:
            kind = f"{self._use('Many')}[{kind}]" if asked else f"tuple[{kind}, ...]"
        return kind, is_list

    def _default(self, field: Any, rules: Any, kind: str, is_list: bool) -> str:
        if rules.default == "{}":
            return f"{kind}()"
        if rules.default and field.type == Field.TYPE_ENUM:
            return f"{kind}({_literal(rules.default)})"
        if rules.default:
            text = _literal(rules.default) if kind == "str" else str(rules.default)
            return {"true": "True", "false": "False"}.get(text, text)
        if is_list:
            return "()"
        if field.type in (Field.TYPE_MESSAGE, Field.TYPE_ENUM) or field.proto3_optional:
            return "None"
        return {"float": "0.0", "bool": "False", "str": '""'}.get(TYPES.get(field.type, ""), "0")

    def _limits(self, rules: Any, counted: bool) -> Iterator[str]:
        for limit, word, size in (("min", "ge", "min_length"), ("max", "le", "max_length")):
            if rules.HasField(limit):
                yield f"{size if counted else word}={getattr(rules, limit):.17g}"


def _comments(file: descriptor_pb2.FileDescriptorProto) -> Iterator[tuple[str, str]]:
    """Names of messages and of their fields with the comments, each as one line."""
    for place in file.source_code_info.location:
        text = " ".join(place.leading_comments.split())
        match list(place.path):
            case [4, message]:
                yield file.message_type[message].name, text
            case [4, message, 2, field]:
                kind = file.message_type[message]
                yield f"{kind.name}.{kind.field[field].name}", text


def goal_fields(files: FileDescriptorSet) -> str:
    """A module with the fields of a goal beside its place, for the Python client's functions."""
    comments = {name: text for file in files.file for name, text in _comments(file)}
    goal = next(kind for file in files.file for kind in file.message_type if kind.name == "Goal")
    text = '"""Generated from proto/wayfarer/v1."""\n\nfrom typing import TypedDict\n\n\n'
    text += "class GoalFields(TypedDict, total=False):\n"
    text += '    """How to walk to a place."""\n'
    for field in goal.field:
        if field.name != "position":
            text += f"\n    {field.name}: {TYPES[field.type]} | None\n"
            text += _docstring(comments[f"Goal.{field.name}"])
    return text


def _short(field: Any) -> str:
    return str(field.type_name).removeprefix(f".{FULL}")


def _oneof(kind: descriptor_pb2.DescriptorProto) -> set[str]:
    """Fields of its oneof."""
    return {f.name for f in kind.field if f.HasField("oneof_index") and not f.proto3_optional}


def _literal(text: str) -> str:
    return repr(text) if '"' in text else f'"{text}"'


def _docstring(text: str) -> str:
    lines = textwrap.wrap(f'"""{text}', WIDTH - 4, subsequent_indent="")
    if len(lines) == 1 and len(lines[0]) <= WIDTH - 7:
        return f'    {lines[0]}"""\n'
    return "".join(f"    {line}\n" for line in lines) + '    """\n'


def _call(start: str, arguments: list[str | tuple[str, str]]) -> str:
    """A call, laid out as ruff does; a pair is the name of an argument, with =, and its text."""
    short = ", ".join(a if isinstance(a, str) else a[0] + _literal(a[1]) for a in arguments)
    if len(f"{start}({short})") <= WIDTH:
        return f"{start}({short})\n"
    if len(short) <= WIDTH - 8:
        return f"{start}(\n{' ' * 8}{short}\n    )\n"
    lines = [a if isinstance(a, str) else a[0] + _pieces(a[1], len(a[0])) for a in arguments]
    comma = "" if len(lines) == 1 else ","
    return f"{start}(\n" + "".join(f"{' ' * 8}{line}{comma}\n" for line in lines) + "    )\n"


def _pieces(text: str, taken: int) -> str:
    """A long text as literals, one a line; `taken` characters stand before the first."""
    pieces = [""]
    for word in text.replace(" ", " \n").split("\n"):
        room = WIDTH - 11 - (taken if len(pieces) == 1 else 0) - word.count('"')
        if len(pieces[-1]) + len(word) > room:
            pieces.append("")
        pieces[-1] += word
    return f"\n{' ' * 8}".join(map(_literal, pieces))
