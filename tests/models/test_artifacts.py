import json
from dataclasses import replace

import pytest

from tests.engines.graphs import IDENTITIES, save, step_model, write_folder
from wayfarer.errors import ArtifactError
from wayfarer.models import artifacts
from wayfarer.models.artifacts import (
    MANIFEST,
    contract_for,
    contract_to_json,
    load_model_folder,
    names_sha256,
    sha256_of,
)
from wayfarer.terms import TERMS


@pytest.fixture
def folder(tmp_path):
    return write_folder(tmp_path / "tiny")


def load(path, **options):
    return load_model_folder(path, IDENTITIES, **options)


def rewrite(path, **values):
    manifest = json.loads((path / MANIFEST).read_text()) | values
    (path / MANIFEST).write_text(json.dumps(manifest))


def test_what_is_written_is_loaded(folder):
    models = load(folder)
    assert (models.name, models.body) == ("tiny", "stick")
    assert models.card.read_text().startswith("# A tiny model")
    assert models.graph("step", "male", 2) == folder / "step_male.onnx"
    contract = models.contracts["step_female.onnx"]
    assert contract == contract_for("step_female.onnx", "tiny", IDENTITIES["female"])
    assert (contract.fps, contract.primitive_frames, contract.seed_frames) == (40, 10, 2)
    assert contract.terms == TERMS


def test_a_graph_that_is_not_there_is_named(folder):
    with pytest.raises(ArtifactError, match=r"holds no .*predictor.*step_female"):
        load(folder).graph("predictor", seed_frames=1)
    with pytest.raises(ArtifactError, match=r"predictor_2f\.onnx is missing"):
        load(folder, required=["predictor_2f.onnx"])


def test_a_changed_byte_is_found_in_any_file(folder):
    for path in sorted(folder.iterdir()):
        if path.name == MANIFEST:
            continue
        before = path.read_bytes()
        path.write_bytes(before[:-1] + bytes([before[-1] ^ 1]))
        with pytest.raises(ArtifactError, match=rf"{path.name}: sha256: found '.*', expected '"):
            load(folder)
        path.write_bytes(before)
    load(folder)


def test_a_missing_file_is_named(folder):
    (folder / "weights.bin").unlink()
    with pytest.raises(ArtifactError, match=r"weights\.bin: cannot be read"):
        load(folder)
    with pytest.raises(ArtifactError, match=r"manifest\.json: cannot be read"):
        load(folder / "nowhere")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"fps": 40', '"fps": 30', "fps: found 30, expected 40"),
        ('"schema": 1', '"schema": 2', "schema: found 2, expected 1"),
        ('"kind": "step"', '"kind": "policy"', "kind: found 'policy', expected 'step'"),
        ('"model": "tiny"', '"model": "other"', "model: found 'other', expected 'tiny'"),
        ('"latent": 128', '"latent": 64', "latent: found 64, expected 128"),
        ('"facing", "speed"', '"speed", "facing"', "terms: found"),
        ('"body": "stick"', '"body": "smplx"', "body: found 'smplx', expected 'stick'"),
        ("hash of", "another hash of", "body_sha256: found 'another hash"),
        ('"fps": 40, ', "", "found fields"),
        ('"markers": 67', '"markers": 67, "more": 1', "found fields"),
        ('{"schema"', "[", "is not JSON"),
    ],
)
def test_a_contract_that_does_not_fit_is_refused(tmp_path, old, new, message):
    with pytest.raises(ArtifactError, match=message) as error:
        load(write_folder(tmp_path / "tiny", **{old: new}))
    assert "step_" in str(error.value)


@pytest.mark.parametrize("old", ['"floor_origin": true, ', '"manner": 8, '])
def test_a_model_of_an_earlier_build_is_refused_with_its_cure(tmp_path, old):
    with pytest.raises(ArtifactError) as error:
        load(write_folder(tmp_path / "tiny", **{old: ""}))
    text = str(error.value)
    assert "\n" not in text and "step_" in text and "another build" in text
    assert "`wayfarer export`" in text


def test_another_order_of_markers_is_refused(folder):
    names = IDENTITIES["male"].marker_names
    swapped = (names[1], names[0], *names[2:])
    bodies = {g: replace(i, marker_names=swapped) for g, i in IDENTITIES.items()}
    with pytest.raises(ArtifactError, match="marker_names_sha256"):
        load_model_folder(folder, bodies)
    assert names_sha256(names) != names_sha256(swapped)


def test_a_graph_in_the_place_of_another_is_refused(folder):
    (folder / "step_male.onnx").write_bytes((folder / "step_female.onnx").read_bytes())
    artifacts.write_manifest(folder, "tiny", "stick")
    with pytest.raises(ArtifactError, match=r"step_male.onnx: gender: found 'female'"):
        load(folder)


def test_a_graph_without_a_contract_is_refused(folder):
    save(step_model(), folder / "step_male.onnx", None)
    artifacts.write_manifest(folder, "tiny", "stick")
    with pytest.raises(ArtifactError, match=r"metadata: found keys \[\], expected 'wayfarer'"):
        load(folder)


def test_a_file_that_is_no_graph_is_refused(folder):
    (folder / "step_male.onnx").write_bytes(b"not a graph")
    artifacts.write_manifest(folder, "tiny", "stick")
    with pytest.raises(ArtifactError, match=r"step_male.onnx: cannot be read: not an ONNX file"):
        load(folder)


def test_unknown_graphs_are_refused(folder):
    contract = contract_for("step_male.onnx", "tiny", IDENTITIES["male"])
    save(step_model(), folder / "critic.onnx", contract_to_json(contract))
    artifacts.write_manifest(folder, "tiny", "stick")
    with pytest.raises(ArtifactError, match=r"found critic\.onnx, expected"):
        load(folder)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"schema": 2}, "schema: found 2, expected 1"),
        ({"body": "smplx"}, "body: found 'smplx', expected 'stick'"),
        ({"files": []}, r"files: found \[\], expected an object"),
        ({"card": "README.md"}, "README.md is missing"),
        ({"more": 1}, "found fields"),
    ],
)
def test_a_manifest_that_does_not_fit_is_refused(folder, values, message):
    rewrite(folder, **values)
    with pytest.raises(ArtifactError, match=message):
        load(folder)


def test_a_manifest_cannot_name_files_elsewhere(folder):
    outside = folder.parent / "outside.bin"
    outside.write_bytes(b"x")
    files = json.loads((folder / MANIFEST).read_text())["files"]
    rewrite(folder, files=files | {"../outside.bin": sha256_of(outside)})
    with pytest.raises(ArtifactError, match="expected a plain file name"):
        load(folder)
