"""Loading bodies by name, and how damaged files are refused."""

import json
import shutil

import numpy as np
import pytest

from wayfarer.body import library
from wayfarer.body.library import LAYOUT, load_arrays, load_body, write_manifest
from wayfarer.errors import ArtifactError, NotFound
from wayfarer.spec import GENDERS


@pytest.mark.parametrize(
    ("arguments", "allowed"),
    [
        (("smpl", "male"), "anny52, smplx"),
        (("anny52", "neutral"), "male, female"),
        (("anny52", "male", "medium"), "high, low"),
    ],
)
def test_unknown_names_are_answered_with_the_known_ones(arguments, allowed):
    with pytest.raises(NotFound, match=allowed):
        load_body(*arguments)


def test_bodies_are_loaded_once():
    assert load_body("anny52", "male") is load_body("anny52", "male")


def test_sizes():
    files = list(library.FOLDER.iterdir())
    assert sum(path.stat().st_size for path in files) < 8e6
    high, low = (load_body("anny52", "female", detail) for detail in library.DETAILS)
    assert len(high.bind_vertices) == 13718
    assert len(low.bind_vertices) < 1500
    for body in (high, low):
        assert body.faces.max() < len(body.bind_vertices)
        np.testing.assert_allclose(body.skin_weights.sum(-1), 1.0, atol=1e-12)
        assert len(body.regions) == len(body.bind_vertices)


@pytest.mark.parametrize("gender", GENDERS)
def test_the_report_keeps_its_promises(gender):
    error = library.report("anny52", gender)["error_mm"]
    assert error["representation"]["mean"] < 1.0
    assert error["skinning"]["mean"] < 1.0
    assert error["posed"]["mean"] < 3.0


@pytest.fixture
def copy(tmp_path):
    shutil.copy(library.body_file("anny52", "male"), tmp_path)
    write_manifest(tmp_path)
    return tmp_path / "anny52_male.npz"


def test_a_changed_file_is_refused(copy):
    data = bytearray(copy.read_bytes())
    data[1000] ^= 1
    copy.write_bytes(data)
    with pytest.raises(ArtifactError, match="SHA-256"):
        load_arrays(copy)


def test_a_file_that_is_not_in_the_manifest_is_refused(copy):
    (copy.parent / library.MANIFEST).write_text("{}")
    with pytest.raises(ArtifactError, match="the manifest says None"):
        load_arrays(copy)


def test_another_layout_is_refused(copy):
    np.savez(copy, meta=np.array(json.dumps({"layout": LAYOUT + 1})))
    write_manifest(copy.parent)
    with pytest.raises(ArtifactError, match="bake the body again"):
        load_arrays(copy)


def test_an_archive_that_is_none_is_refused(copy):
    copy.write_text("no zip")
    write_manifest(copy.parent)
    with pytest.raises(ArtifactError, match="cannot be read as npz"):
        load_arrays(copy)


def test_missing_arrays_are_named(copy):
    arrays = dict(load_arrays(copy))
    del arrays["faces"]
    with pytest.raises(ArtifactError, match="faces"):
        library.body_from_arrays("anny52", "male", arrays)


def test_smplx_tells_how_to_bring_ones_own_files(monkeypatch, tmp_path):
    monkeypatch.delenv(library.SMPLX_FOLDER, raising=False)
    with pytest.raises(NotFound, match=library.SMPLX_FOLDER):
        load_body("smplx", "neutral")
    monkeypatch.setenv(library.SMPLX_FOLDER, str(tmp_path))
    with pytest.raises(ArtifactError, match=r"SMPLX_NEUTRAL\.npz"):
        load_body("smplx", "neutral")
