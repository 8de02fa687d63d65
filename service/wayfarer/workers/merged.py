"""One answer out of those of all workers."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final

from google.protobuf.message import Message

from wayfarer.transport import schema

WORST: Final = ("degradation_level",)
"""Whole numbers of which the greatest counts, not the sum."""


LISTED: Final = ("sessions", "scenes")
"""Lists that are in order of creation."""


def merged_messages(replies: Sequence[Message]) -> Any:
    """One reply for gRPC replies of one type: lists joined, counts added, else the first's."""
    first: Any = replies[0]
    for reply in replies[1:]:
        for field in first.DESCRIPTOR.fields:
            found: Any = getattr(reply, field.name)
            if field.is_repeated:
                getattr(first, field.name).extend(found)
            elif field.type == field.TYPE_UINT32:
                setattr(first, field.name, getattr(first, field.name) + found)
    for name in LISTED:
        if hasattr(first, name):
            getattr(first, name).sort(key=lambda item: item.created_at_us)
    return first


def merged_json(replies: Sequence[Any]) -> Any:
    """HTTP documents as one, likewise."""
    first = replies[0]
    if not isinstance(first, dict):
        return first
    joined = dict(first)
    for key, value in first.items():
        values = [reply[key] for reply in replies]
        if isinstance(value, list):
            joined[key] = [item for found in values for item in found]
        elif isinstance(value, int) and not isinstance(value, bool):
            joined[key] = sum(values)
    for name in LISTED:
        if name in joined:
            joined[name].sort(key=lambda item: item["created_at_us"])
    return joined


def merged_stats(found: Sequence[schema.Stats]) -> schema.Stats:
    """Counts added; of times, shares and levels the worst; of uptimes the shortest."""
    merged: dict[str, Any] = {}
    for name in schema.Stats.model_fields:
        values = [getattr(stats, name) for stats in found]
        if isinstance(values[0], bool):
            merged[name] = any(values)
        elif isinstance(values[0], dict):
            merged[name] = dict(sum((Counter(value) for value in values), Counter()))
        elif name == "uptime_s":
            merged[name] = min(values)
        elif isinstance(values[0], float) or name in WORST:
            merged[name] = max(values)
        else:
            merged[name] = sum(values)
    return schema.Stats(**merged)
