"""Opaque bytes for outside the server: a JSON header and arrays, compressed, of several kinds.

    8 bytes  magic and kind        b"WAYFSNAP", b"WAYFCLOG"
    2 bytes  format version        uint16, little-endian
    4 bytes  length of the header  uint32, little-endian
    rest     zlib (with its checksum) of: header, then arrays

A client may send anything here. Nothing is executed (no pickle), and nothing larger than the
reader's own bound is ever inflated: a header that promises more is refused, and so is a stream
that holds more.
"""

import struct
import zlib
from enum import Enum
from typing import Final

from wayfarer.errors import FailedPrecondition, InvalidArgument

VERSION: Final = 1

BETWEEN_SERVERS: Final = 9
"""To be raised when what only servers send each other changes: live sessions, replicas, and the
calls that bring them (cluster/node_agent.py). Nodes of other numbers are of another kind.
"""

_HEAD: Final = struct.Struct("<8sHI")
LEVEL: Final = 1  # poses hardly shrink; goals and names do at any level


class ContainerKind(Enum):
    """The kind of a container's contents."""

    SNAPSHOT = b"WAYFSNAP"
    LOG = b"WAYFCLOG"

    @property
    def field(self) -> str:
        """Name of the request's field that brings it."""
        return self.name.lower()


def seal(kind: ContainerKind, header: bytes, arrays: bytes, level: int = LEVEL) -> bytes:
    """The container."""
    body = zlib.compress(header + arrays, level)
    return _HEAD.pack(kind.value, VERSION, len(header)) + body


def beginning(kind: ContainerKind, data: bytes, most: int) -> bytes:
    """The first `most` bytes of what was sealed, or less. What follows is not looked at.

    Raises as `unseal`.
    """
    _header_bytes(kind, data)
    try:
        return zlib.decompressobj().decompress(memoryview(data)[_HEAD.size :], most)
    except zlib.error as error:
        raise InvalidArgument(f"{kind.field} is damaged: {error}", kind.field) from None


def unseal(kind: ContainerKind, data: bytes, most: int) -> tuple[bytes, bytes]:
    """The header and the arrays of a container of at most `most` bytes.

    Raises InvalidArgument; FailedPrecondition when it is of another version.
    """
    header = _header_bytes(kind, data)
    body = _inflate(kind, memoryview(data)[_HEAD.size :], most)
    if header > len(body):
        raise InvalidArgument(f"{kind.field} is cut short within its header", kind.field)
    return body[:header], body[header:]


def _header_bytes(kind: ContainerKind, data: bytes) -> int:
    """Length that the header should have. Raises as `unseal`."""
    if len(data) < _HEAD.size:
        raise InvalidArgument(f"{kind.field} is cut short: it has {len(data)} bytes", kind.field)
    magic, version, header = _HEAD.unpack_from(data)
    if magic != kind.value:
        raise InvalidArgument(
            f"{kind.field} does not begin as one of Wayfarer's: {magic!r}", kind.field
        )
    if version != VERSION:
        raise FailedPrecondition(
            f"{kind.field} has format {version}; this server reads format {VERSION}"
        )
    return int(header)


def _inflate(kind: ContainerKind, data: memoryview, most: int) -> bytes:
    stream = zlib.decompressobj()
    try:
        body = stream.decompress(data, most + 1)
    except zlib.error as error:
        raise InvalidArgument(f"{kind.field} is damaged: {error}", kind.field) from None
    if len(body) > most:
        raise InvalidArgument(
            f"{kind.field} holds more than {most} bytes, the most that this server's limits allow",
            kind.field,
        )
    if not stream.eof or stream.unused_data:
        raise InvalidArgument(f"{kind.field} is cut short or has bytes after its end", kind.field)
    return body
