"""Hostile bytes for a server: messages with extreme values, also changed, cut off, blown up, or
entirely random."""

import math
import random
from collections.abc import Callable, Sequence

from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass

FLOATS = (
    *(0.0, -0.0, 1.0, -1.5, 40.0, 1e-45, 1e-308, 1e9, 3.4e38, 1e308),
    *(math.nan, math.inf, -math.inf),
)
INTEGERS = (0, 1, 2, 7, 10, 40, 255, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**63 - 1, 2**64 - 1)
TEXTS = (
    *("", "a", "fake", "gltf", "../../etc/passwd", "%s%n", "' OR 1=1 --", "\x00", "\n" * 40),
    *("\u202e\u0000\ud7ff", "🚶" * 20, "x" * 300, "x" * 20_000),
)
MAX_REPEATED = 1500
DEEPEST = 5

KINDS = ("extreme", "mutated", "truncated", "oversized", "random")
SHARES = (40, 35, 12, 1, 12)


class Inputs:
    """Draws inputs for messages. `known` names things that exist, by the name of their field."""

    def __init__(self, seed: int, message_bytes: int) -> None:
        """Oversized inputs have more than `message_bytes`."""
        self.chance = random.Random(seed)
        self.known: dict[str, list[str]] = {}
        self._message_bytes = message_bytes

    def draw(self, descriptor: Descriptor) -> tuple[str, bytes]:
        """A kind, and bytes for a message."""
        kind = self.chance.choices(KINDS, SHARES)[0]
        return kind, getattr(self, f"_{kind}")(descriptor)

    def message(self, descriptor: Descriptor, depth: int = 0) -> Message:
        """A message of the type with values that a client could send, but would not."""
        made = GetMessageClass(descriptor)()
        for field in descriptor.fields:
            if self.chance.random() < 0.3 or depth > DEEPEST:
                continue
            if field.is_repeated:
                values = [self._value(field, depth) for _ in range(self._count(depth))]
                if field.message_type and field.message_type.GetOptions().map_entry:
                    continue
                getattr(made, field.name).extend(values)
            elif field.message_type:
                getattr(made, field.name).CopyFrom(self._value(field, depth))
            else:
                setattr(made, field.name, self._value(field, depth))
        return made

    def mutate(self, data: bytes) -> bytes:
        """A few changes of the sort that wires and attackers make."""
        changed = bytearray(data or b"\x0a\x00")
        for _ in range(self.chance.choice((1, 1, 2, 5, 20))):
            at = self.chance.randrange(len(changed) + 1)
            self.chance.choice(MUTATIONS)(self.chance, changed, at)
            if not changed:
                changed += b"\x00"
        return bytes(changed)

    def text(self, name: str = "") -> str:
        """A known thing of that name, or an unusual text."""
        if (known := self.known.get(name)) and self.chance.random() < 0.75:
            return self.chance.choice(known)
        return self.chance.choice(TEXTS)

    def _extreme(self, descriptor: Descriptor) -> bytes:
        return self.message(descriptor).SerializePartialToString()

    def _mutated(self, descriptor: Descriptor) -> bytes:
        return self.mutate(self._extreme(descriptor))

    def _truncated(self, descriptor: Descriptor) -> bytes:
        data = self._extreme(descriptor)
        return data[: self.chance.randrange(len(data) + 1)]

    def _random(self, descriptor: Descriptor) -> bytes:
        return self.chance.randbytes(int(2 ** self.chance.uniform(0, 12)))

    def _oversized(self, descriptor: Descriptor) -> bytes:
        size = self._message_bytes + self.chance.choice((-64, 1, 4096, self._message_bytes))
        filler = self._extreme(descriptor) or b"\x0a\x00"
        return (filler * (size // len(filler) + 1))[:size]

    def _count(self, depth: int) -> int:
        if depth == 0 and self.chance.random() < 0.02:
            return MAX_REPEATED
        return self.chance.choice((0, 1, 1, 2, 3, 10, 11))

    def _value(self, field: FieldDescriptor, depth: int) -> object:
        if field.message_type:
            return self.message(field.message_type, depth + 1)
        if field.enum_type:
            numbers = [value.number for value in field.enum_type.values]
            return self.chance.choice([*numbers, 99, -1])
        if field.cpp_type in (FieldDescriptor.CPPTYPE_DOUBLE, FieldDescriptor.CPPTYPE_FLOAT):
            usual = self.chance.uniform(-5, 5)
            return self.chance.choice((usual, usual, self.chance.choice(FLOATS)))
        if field.cpp_type == FieldDescriptor.CPPTYPE_BOOL:
            return self.chance.random() < 0.5
        if field.type == FieldDescriptor.TYPE_BYTES:
            return self.chance.randbytes(self.chance.choice((0, 1, 16, 300)))
        if field.cpp_type == FieldDescriptor.CPPTYPE_STRING:
            return self.text(field.name)
        return self._integer(field)

    def _integer(self, field: FieldDescriptor) -> int:
        signed = field.cpp_type in (FieldDescriptor.CPPTYPE_INT32, FieldDescriptor.CPPTYPE_INT64)
        bits = (
            32
            if field.cpp_type
            in (
                FieldDescriptor.CPPTYPE_INT32,
                FieldDescriptor.CPPTYPE_UINT32,
            )
            else 64
        )
        value = self.chance.choice(INTEGERS) % 2**bits
        return value - 2**bits if signed and value >= 2 ** (bits - 1) else value


Mutation = Callable[[random.Random, bytearray, int], None]


def _flip(chance: random.Random, data: bytearray, at: int) -> None:
    if at < len(data):
        data[at] ^= 1 << chance.randrange(8)


def _set(chance: random.Random, data: bytearray, at: int) -> None:
    data[at : at + 1] = bytes([chance.choice((0, 1, 0x7F, 0x80, 0xFF, chance.randrange(256)))])


def _insert(chance: random.Random, data: bytearray, at: int) -> None:
    data[at:at] = chance.randbytes(chance.choice((1, 2, 8)))


def _delete(chance: random.Random, data: bytearray, at: int) -> None:
    del data[at : at + chance.choice((1, 2, 8))]


def _repeat(chance: random.Random, data: bytearray, at: int) -> None:
    data[at:at] = data[at : at + chance.choice((2, 8, 64))] * chance.choice((2, 16))


def _endless_varint(chance: random.Random, data: bytearray, at: int) -> None:
    data[at:at] = b"\xff" * chance.choice((5, 10, 11))


def _long_length(chance: random.Random, data: bytearray, at: int) -> None:
    tag = chance.randrange(1, 16) << 3 | 2
    data[at:at] = bytes([tag]) + chance.choice((b"\xff\xff\xff\xff\x07", b"\x80\x80\x80\x01"))


def _groups(chance: random.Random, data: bytearray, at: int) -> None:
    data[at:at] = bytes([chance.randrange(1, 16) << 3 | 3]) * chance.choice((1, 50, 200))


def _nests(chance: random.Random, data: bytearray, at: int) -> None:
    nest = b""
    for _ in range(chance.choice((3, 60))):
        nest = b"\x0a" + bytes([min(len(nest), 127)]) + nest
    data[at:at] = nest


def _number(chance: random.Random, data: bytearray, at: int) -> None:
    tag = chance.randrange(1, 16) << 3
    data[at:at] = chance.choice(
        (
            bytes([tag | 1]) + b"\x00\x00\x00\x00\x00\x00\xf8\x7f",  # a double: NaN
            bytes([tag | 1]) + b"\x00\x00\x00\x00\x00\x00\xf0\x7f",  # infinite
            bytes([tag | 5]) + b"\x00\x00\x80\x7f",  # a float
            bytes([tag]) + b"\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",  # an integer: -1
        )
    )


MUTATIONS: Sequence[Mutation] = (
    *(_flip, _flip, _set, _insert, _delete, _repeat),
    *(_endless_varint, _long_length, _groups, _nests, _number),
)
