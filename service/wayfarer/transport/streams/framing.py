"""Protobuf messages joined from parts that are encoded already.

The encoding of a message is the concatenation of its fields, in any order; a nested message is its
length and its bytes. So large parts are copied only once, into the finished message.
https://protobuf.dev/programming-guides/encoding/
"""

from collections.abc import Iterable
from typing import Final

Part = bytes | memoryview
"""A memoryview has single bytes as items."""

LENGTH_DELIMITED: Final = 2
"""Wire type of messages and bytes."""


def field(number: int, parts: Iterable[Part]) -> list[Part]:
    """Encodes a message or bytes field whose value is `parts` joined."""
    value = list(parts)
    size = sum(map(len, value))
    return [varint(number << 3 | LENGTH_DELIMITED) + varint(size), *value]


def varint(value: int) -> bytes:
    """Encodes a number ≥ 0: seven bits per byte, the lowest first."""
    groups = []
    while value > 0x7F:
        groups.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*groups, value])
