import struct
from dataclasses import replace

import numpy as np
import pytest

from tests.transport.fakes import chunk
from wayfarer.errors import InvalidArgument
from wayfarer.transport import codec
from wayfarer.transport.basis import Basis


@pytest.mark.parametrize("basis", Basis)
def test_round_trip(basis):
    made = chunk()
    (packed,) = codec.encode([made], basis)
    translation, rotations, contacts = codec.decode(*packed, basis)
    np.testing.assert_allclose(translation, made.translation, rtol=1e-6)
    np.testing.assert_array_equal(rotations, made.rotations)
    np.testing.assert_array_equal(contacts, made.contacts)


def test_golden_bytes():
    """The layout of docs/wire-format.md, byte by byte."""
    rotations = np.zeros((2, 22, 4), np.float32)
    rotations[0, 0] = [0.1, 0.2, 0.3, 0.4]
    rotations[1, 21] = [0.5, 0.6, 0.7, 0.8]
    made = replace(
        chunk(),
        translation=np.array([[1, 2, 3], [4, 5, 6]], np.float32),
        rotations=rotations,
        contacts=np.array([[True, False], [True, True]]),
    )
    (packed,) = codec.encode([made], Basis.GLTF)
    assert len(packed.poses) == 2 * 364
    # core (x, y, z) is glTF (-x, z, y)
    assert packed.poses[:28] == struct.pack("<7f", -1, 3, 2, -0.1, 0.3, 0.2, 0.4)
    assert packed.poses[364:376] == struct.pack("<3f", -4, 6, 5)
    assert packed.poses[-16:] == struct.pack("<4f", -0.5, 0.7, 0.6, 0.8)
    assert packed.contacts == b"\x01\x03"


def test_chunks_of_a_batch_do_not_depend_on_each_other():
    chunks = [chunk(alias=1), replace(chunk(hips=(5, 6, 7)), alias=2), chunk(alias=3)]
    short = chunks[1]
    chunks[1] = replace(
        short,
        translation=short.translation[:3],
        rotations=short.rotations[:3],
        contacts=short.contacts[:3],
    )
    together = codec.encode(chunks, Basis.UNREAL)
    assert together == [codec.encode([c], Basis.UNREAL)[0] for c in chunks]
    assert [len(p.contacts) for p in together] == [8, 3, 8]
    assert codec.encode([], Basis.GLTF) == []


def test_lengths_that_do_not_fit_are_refused():
    with pytest.raises(InvalidArgument, match="364 bytes"):
        codec.decode(bytes(364), bytes(2), Basis.GLTF)


def test_each_chunk_is_encoded_once_per_basis(monkeypatch):
    encoded = []
    plain = codec.encode

    def counting(chunks, basis):
        encoded.extend((basis, c.seq) for c in chunks)
        return plain(chunks, basis)

    monkeypatch.setattr(codec, "encode", counting)
    encoder = codec.PoseEncoder()
    a, b = chunk(seq=0), chunk(seq=1)
    first = encoder.encode([a, b], Basis.GLTF)
    assert encoder.encode([b], Basis.GLTF) == first[1:]
    assert encoder.encode([a, b], Basis.GLTF) == first
    assert encoder.encode([a], Basis.ROS) == plain([a], Basis.ROS)
    assert encoded == [(Basis.GLTF, 0), (Basis.GLTF, 1), (Basis.ROS, 0)]


def test_memory_is_bounded():
    encoder = codec.PoseEncoder(capacity=2)
    chunks = [chunk(seq=i) for i in range(5)]
    assert len(encoder.encode(chunks, Basis.GLTF)) == 5
    assert len(encoder._packed) == 2
