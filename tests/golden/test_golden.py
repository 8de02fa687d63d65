"""The files are what the server sends today, and the Python client reads them."""

import json

import numpy as np
import pytest

from tests.golden import gait, homes, messages, rules, tiers, vectors, words
from tests.golden.vectors import FILE, FIRST_FRAME, FOLDER, Vector
from tests.wire_poses import quaternions_to_core
from wayfarer.transport.codec import PoseEncoding, PoseProfile
from wayfarer.transport.conversion.basis import Basis
from wayfarer_client.poses import PoseLayout
from wayfarer_client.v1 import catalog_pb2, motion_pb2

DOCUMENT = json.loads(FILE.read_text())
ENTRIES = DOCUMENT["vectors"]
each = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry["name"])


@pytest.mark.parametrize("made", [vectors, messages, homes, rules, words, gait, tiers])
def test_files_are_up_to_date(made):
    for path, content in made.files().items():
        kept = path.read_bytes()
        same = kept == content or (
            path.suffix == ".json" and alike(json.loads(kept), json.loads(content))
        )
        assert same, f"{path.name}: run python -m tests.golden"


def alike(a, b):
    """Whether they are equal, numbers except for the last digit, which differs with AVX-512."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(alike(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(alike, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return a == pytest.approx(b, rel=1e-6, abs=2e-6)
    return type(a) is type(b) and a == b


def test_alike_sees_what_differs():
    one = {"a": [1, 0.1, "x"], "b": None}
    assert alike(one, {"a": [1, 0.1000001, "x"], "b": None})
    for other in (0.2, {"a": [1, 0.1]}, {"a": [1, 0.1001, "x"], "b": None}, {**one, "b": 0}):
        assert not alike(one, other)


def test_nothing_is_left_over():
    listed = {entry["poses"] for entry in ENTRIES}
    assert {f"poses/{path.name}" for path in (FOLDER / "poses").iterdir()} == listed
    combinations = {(e["basis"], e["encoding"], e["profile"]) for e in ENTRIES}
    assert len(combinations) == len(Basis) * len(vectors.ENCODINGS) * len(PoseProfile)
    assert {e["sent_fps"] for e in ENTRIES} == {40, 20, 10}


@each
def test_the_server_sends_these_bytes(entry):
    """They are made from the motion in the file, which is therefore complete."""
    vector = Vector(
        Basis(entry["basis"]),
        PoseEncoding(entry["encoding"]),
        PoseProfile(entry["profile"]),
        entry["sent_fps"],
    )
    packed = vector.pack(vectors.motion_of(DOCUMENT["core"]))
    assert packed.poses == (FOLDER / entry["poses"]).read_bytes()
    assert packed.contacts.hex() == entry["contacts"]
    assert entry["first_frame"] == FIRST_FRAME
    assert vector.pose_format.bones == tuple(entry["bones"])


@each
def test_the_python_client_reads_them(entry):
    header = motion_pb2.StreamHeader(
        fps=40,
        sent_fps=entry["sent_fps"],
        bones=entry["bones"],
        skeleton=catalog_pb2.Skeleton(posed_bones=22),
        pose_encoding=f"POSE_ENCODING_{entry['encoding'].upper()}",
    )
    layout = PoseLayout(header)
    found = layout.unpack((FOLDER / entry["poses"]).read_bytes())
    wanted = DOCUMENT["bases"][entry["basis"]]
    frames = entry["frames"]
    np.testing.assert_array_equal(
        found.translation, np.array(wanted["translation"], np.float32)[frames]
    )
    rotations = np.concatenate(
        [np.array(wanted["rotations"], np.float32), np.tile([0, 0, 0, 1], (5, 30, 1))], axis=1
    )[frames][:, entry["bones"]]
    assert found.rotations.shape == rotations.shape and found.rotations.dtype == np.float32
    tolerance = DOCUMENT["tolerance_deg"][entry["encoding"]]
    if tolerance == 0:
        np.testing.assert_array_equal(found.rotations, rotations)
    chord = np.minimum(
        np.linalg.norm(found.rotations - rotations, axis=-1),
        np.linalg.norm(found.rotations + rotations, axis=-1),
    )
    assert np.degrees(4 * np.arcsin(chord / 2)).max() <= tolerance


@pytest.mark.parametrize(
    "case", json.loads(tiers.FILE.read_text())["cases"], ids=lambda c: c["basis"]
)
def test_a_person_drawn_by_his_root_walks_as_he_does(case):
    """It is in step, upright, and at the same place; the legs are compared with the packed walk."""
    axes = Basis(case["basis"]).axes
    _, root = case["tiers"]
    frames = 2 * tiers.CHUNKS
    hips = axes.points_to_core(np.array(root["hips"]).reshape(-1, 3)[:frames])
    drawn = np.array(root["rotations"]).reshape(-1, 22, 4)[:frames]
    drawn = quaternions_to_core(axes, drawn)
    walk = [made for chunk in tiers.chunks() for made in chunk]
    real = np.concatenate([made.rotations[::4] for made in walk])
    places = np.concatenate([made.translation[::4] for made in walk])
    assert np.abs(hips - places).max() < 0.12
    for bone, most in ((0, 25), (1, 35), (2, 35), (4, 50), (5, 50), (16, 25), (17, 25)):
        cosine = np.abs((drawn[1:, bone] * real[1:, bone]).sum(-1))
        assert np.degrees(2 * np.arccos(cosine.clip(0, 1))).mean() < most, bone
