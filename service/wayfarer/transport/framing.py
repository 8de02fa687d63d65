"""Protobuf messages put together from parts that are encoded already.

The encoding of a message is that of its fields, one after the other, in any order; a message within
it is its length and its bytes. So what is large is copied once, into the finished message.
https://protobuf.dev/programming-guides/encoding/
"""

from collections.abc import Iterable
from typing import Final

Part = bytes | memoryview
"""A view is of single bytes."""

LENGTH_DELIMITED: Final = 2
"""Wire type of messages and bytes."""


def field(number: int, parts: Iterable[Part]) -> list[Part]:
    """A message or bytes field, to be joined with others; its value is `parts` joined."""
    value = list(parts)
    size = sum(map(len, value))
    return [varint(number << 3 | LENGTH_DELIMITED) + varint(size), *value]


def varint(value: int) -> bytes:
    """A number from 0 on: seven bits a byte, the lowest first."""
    groups = []
    while value > 0x7F:
        groups.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*groups, value])
