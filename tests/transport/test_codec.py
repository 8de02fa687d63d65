from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tests.transport.samples import chunk
from tests.wire_poses import decode
from wayfarer.body.skeleton import load_skeleton
from wayfarer.errors import InvalidArgument
from wayfarer.transport import codec, schema
from wayfarer.transport.codec import PoseEncoding, PoseFormat, PoseProfile, smallest_three
from wayfarer.transport.conversion import convert, wire
from wayfarer.transport.conversion.basis import Basis
from wayfarer.v1 import motion_pb2
from wayfarer.world.agents.agent import NO_CHUNKS, ChunkFlag, MotionChunks
from wayfarer_client.poses import unpack_smallest_three

WORST_DEG = {
    PoseEncoding.F32_LE: 1e-4,
    PoseEncoding.SMALLEST_THREE: smallest_three.WORST_ERROR_DEG + 1e-4,
}
FINGERS = slice(22, 52)


def turned(count: int = 8, seed: int = 0):
    """A chunk with rotations drawn at random."""
    rotations = np.random.default_rng(seed).normal(size=(count, 22, 4))
    rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
    return replace(chunk(), rotations=rotations.astype(np.float32))


def chosen(request):
    """The format that a client asks for, as every call reads it."""
    return convert.pose_format(wire.parse(schema.PoseFormat, request, "format"))


def encode(made, basis, pose_format=PoseFormat()):
    """One chunk packed."""
    return codec.encode(MotionChunks.of([made]), basis, pose_format)


def degrees_between(a, b) -> np.ndarray:
    """Angles between rotations, exact for small ones."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    a, b = (q / np.linalg.norm(q, axis=-1, keepdims=True) for q in (a, b))
    chord = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return np.degrees(4 * np.arcsin(chord / 2))


@pytest.mark.parametrize("basis", Basis)
@pytest.mark.parametrize("encoding", WORST_DEG)
def test_round_trip(basis, encoding):
    made, pose_format = turned(), PoseFormat(encoding)
    packed = encode(made, basis, pose_format)
    found = decode(packed.poses, packed.contacts, basis, pose_format)
    np.testing.assert_allclose(found.translation, made.translation, rtol=1e-6)
    assert degrees_between(found.rotations, made.rotations).max() <= WORST_DEG[encoding]
    np.testing.assert_array_equal(found.contacts, made.contacts)


def test_float32_loses_nothing():
    made = turned()
    packed = encode(made, Basis.BLENDER)
    found = decode(packed.poses, packed.contacts, Basis.BLENDER)
    np.testing.assert_array_equal(found.rotations, made.rotations)


@given(
    arrays.arrays(
        np.float64,
        (7, 4),
        elements=st.one_of(st.floats(-1, 1), st.sampled_from([0.0, 0.5, -0.5, 1.0, -1.0])),
    )
)
def test_smallest_three_is_never_off_by_more_than_it_says(rows):
    rows = rows[np.linalg.norm(rows, axis=-1) > 1e-3]
    rows /= np.linalg.norm(rows, axis=-1, keepdims=True)
    words = [smallest_three.pack_one(*row) for row in rows.tolist()]
    found = unpack_smallest_three(np.array(words, np.uint16).reshape(-1, 3))
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-6)
    assert (degrees_between(found, rows) <= smallest_three.WORST_ERROR_DEG + 1e-4).all()


def test_the_stated_error_of_smallest_three_is_reached():
    """Half a step off in three components, all at a half: the bound is tight."""
    half = 0.5 * smallest_three.STEPS_PER_ONE
    near = (np.floor(half) + 0.499 + np.zeros(3)) / smallest_three.STEPS_PER_ONE
    worst = np.array([*near, np.sqrt(1 - (near**2).sum())])
    found = unpack_smallest_three(np.array(smallest_three.pack_one(*worst.tolist()), np.uint16))
    assert degrees_between(found, worst) > 0.95 * smallest_three.WORST_ERROR_DEG


@given(st.lists(st.integers(0, 2**16 - 1), min_size=3, max_size=3))
def test_any_words_are_some_rotation(words):
    found = unpack_smallest_three(np.array(words, np.uint16))
    assert np.isfinite(found).all()


@pytest.mark.parametrize("encoding", WORST_DEG)
def test_full_profile_adds_fingers_at_rest(encoding):
    full = PoseFormat.choose(encoding, PoseProfile.FULL)
    body = PoseFormat.choose(encoding)
    made = turned()
    for basis in Basis:
        long, short = (encode(made, basis, f) for f in (full, body))
        rotations = decode(long.poses, long.contacts, basis, full).rotations
        np.testing.assert_array_equal(
            rotations[:, :22], decode(short.poses, short.contacts, basis, body).rotations
        )
        np.testing.assert_array_equal(rotations[:, FINGERS], np.tile([0, 0, 0, 1], (8, 30, 1)))


def test_chosen_bones_come_in_the_order_of_the_skeleton():
    names = ["left_index1", "head", "pelvis"]
    chosen = PoseFormat.choose(profile=PoseProfile.BONES, bones=names)
    skeleton = [bone.name for bone in load_skeleton()]
    assert chosen.bones == (0, 15, 22) == tuple(sorted(map(skeleton.index, names)))
    made = turned()
    packed = encode(made, Basis.GLTF, chosen)
    found = decode(packed.poses, packed.contacts, Basis.GLTF, chosen)
    np.testing.assert_array_equal(found.rotations[:, :2], made.rotations[:, [0, 15]])
    np.testing.assert_array_equal(found.rotations[:, 2], np.tile([0, 0, 0, 1], (8, 1)))


@pytest.mark.parametrize("fps", [40, 20, 10])
@pytest.mark.parametrize("lengths", [(8, 8, 8), (8, 3), (8, 8, 1)])
def test_frames_are_left_out_evenly_from_chunk_to_chunk(fps, lengths):
    """Whole primitives, of which the last may be cut short: the end of a clip."""
    pose_format, first, sent, numbers = PoseFormat(fps=fps), 40, [], []
    for length in lengths:
        made = turned(length, seed=first)
        made = replace(
            made,
            first_frame=first,
            translation=np.repeat(np.arange(first, first + length)[:, None], 3, 1).astype("f4"),
            contacts=made.contacts[:length],
        )
        packed = encode(made, Basis.ROS, pose_format)
        found = decode(packed.poses, packed.contacts, Basis.ROS, pose_format)
        sent += found.translation[:, 0].tolist()
        numbers += [first + k * pose_format.stride for k in range(len(packed.contacts))]
        np.testing.assert_array_equal(found.contacts, made.contacts[:: pose_format.stride])
        first += length
    assert sent == numbers == list(range(40, 40 + sum(lengths), 40 // fps))


@pytest.mark.parametrize("pose_format", [PoseFormat(), PoseFormat(PoseEncoding.SMALLEST_THREE)])
def test_chunks_of_a_batch_do_not_depend_on_each_other(pose_format):
    chunks = [replace(turned(seed=k), alias=k) for k in range(9)]
    together = codec.encode(MotionChunks.of(chunks), Basis.UNREAL, pose_format)
    alone = [encode(c, Basis.UNREAL, pose_format) for c in chunks]
    assert bytes(together.poses) == b"".join(packed.poses for packed in alone)
    assert together.contacts == b"".join(packed.contacts for packed in alone)
    nothing = codec.encode(NO_CHUNKS, Basis.GLTF)
    assert (bytes(nothing.poses), nothing.contacts) == (b"", b"")


# formats that a client may request


def test_defaults():
    assert chosen(motion_pb2.PoseFormat()) == PoseFormat()
    assert PoseFormat().header() == {
        "pose_encoding": "POSE_ENCODING_F32_LE",
        "sent_fps": 40,
        "bones": tuple(range(22)),
        "frame_bytes": 364,
    }
    motion_pb2.StreamHeader(**PoseFormat().header())


@pytest.mark.parametrize(
    ("choice", "field", "message"),
    [
        ({"fps": 30}, "format.fps", "30 is none of 40, 20, 10 frames per second"),
        ({"encoding": 9}, "format.encoding", "9 is none of POSE_ENCODING_F32_LE, "),
        ({"profile": -1}, "format.profile", "-1 is none of POSE_PROFILE_BODY, "),
        ({"bones": ["head"]}, "format.bones", "with the profile BONES only"),
        ({"profile": 2, "bones": ["head"]}, "format.bones", "with the profile BONES only"),
        ({"profile": 3}, "format.bones", "needs the name of one bone"),
        ({"profile": 3, "bones": ["head", "head"]}, "format.bones", "'head' is named twice"),
        ({"profile": 3, "bones": ["head", "tail"]}, "format.bones", "no bones 'tail'; the skel"),
        ({"profile": 3, "bones": ["x" * 9999]}, "format.bones", f"no bones '{'x' * 32}';"),
        ({"profile": 3, "bones": [f"b{k}" for k in range(20)]}, "format.bones", "and 12 more"),
        ({"profile": 3, "bones": ["head"] * 53}, "format.bones", "allowed: at most 52"),
    ],
)
def test_wrong_choices_are_explained(choice, field, message):
    with pytest.raises(InvalidArgument) as caught:
        chosen(motion_pb2.PoseFormat(**choice))
    assert caught.value.field == field
    assert message in str(caught.value)


# the encoder's memory


@pytest.fixture
def encoded(monkeypatch):
    """The packed chunks: (basis, frames per second, aliases)."""
    packed, plain = [], codec.encode

    def counting(chunks, basis, pose_format):
        packed.append((basis, pose_format.fps, chunks.alias.tolist()))
        return plain(chunks, basis, pose_format)

    monkeypatch.setattr("wayfarer.transport.codec.encoder.encode", counting)
    return packed


def test_chunks_are_packed_once_per_basis_and_format_whoever_has_them(encoded):
    encoder, half = codec.PoseEncoder(), PoseFormat(fps=20)
    chunks = MotionChunks.of([chunk(alias=alias) for alias in range(3)])
    encoder.encode(chunks, Basis.GLTF, rows=np.array([0, 2]))
    found = encoder.encode(chunks, Basis.GLTF, rows=np.array([2, 1]))
    assert found == codec.encode(chunks.take(np.array([2, 1])), Basis.GLTF)
    marked = replace(chunks, flags=np.array([0, ChunkFlag.GAP, 0], np.uint8))
    for again in (chunks, marked, chunks):
        assert encoder.encode(again, Basis.GLTF) == codec.encode(chunks, Basis.GLTF)
    assert encoder.encode(chunks, Basis.ROS) == codec.encode(chunks, Basis.ROS)
    assert encoder.encode(chunks, Basis.GLTF, half) == codec.encode(chunks, Basis.GLTF, half)
    assert encoded == [
        (Basis.GLTF, 40, [0, 2]),
        (Basis.GLTF, 40, [1]),
        (Basis.ROS, 40, [0, 1, 2]),
        (Basis.GLTF, 20, [0, 1, 2]),
    ]


def test_other_motion_with_the_same_numbers_is_not_mixed_up(encoded):
    """A session imported again sends other frames under numbers that it has sent before."""
    encoder = codec.PoseEncoder()
    before = encoder.encode(MotionChunks.of([turned(seed=1)]), Basis.GLTF)
    assert encoder.encode(MotionChunks.of([turned(seed=2)]), Basis.GLTF) != before


def test_memory_is_bounded():
    each = 8 * PoseFormat().frame_bytes
    encoder = codec.PoseEncoder(capacity=2 * each)
    for seq in range(5):
        made = MotionChunks.of([chunk(seq=seq)])
        assert encoder.encode(made, Basis.GLTF) == codec.encode(made, Basis.GLTF)
        assert len(encoder._packed) == min(seq + 1, 2) and encoder._bytes <= 2 * each
    large = MotionChunks.of([chunk(seq=seq) for seq in range(3)])
    assert encoder.encode(large, Basis.GLTF).poses.nbytes == 3 * each
    assert len(encoder._packed) == 1
