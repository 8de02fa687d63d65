import shutil
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.engines.graphs import IDENTITIES, write_folder
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.model_store import ModelStore
from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.errors import ArtifactError, InvalidArgument, NotFound
from wayfarer.models.artifacts import ModelFolder, load_model_folder


@pytest.fixture
def folders(tmp_path):
    """Two folders of models; the name `both` is in both of them."""
    shipped, own = tmp_path / "shipped", tmp_path / "own"
    for folder, names in ((shipped, ("first", "both")), (own, ("v2.1", "both"))):
        folder.mkdir()
        for name in names:
            write_folder(folder / name)
    (own / "notes").mkdir()  # not a model
    return shipped, own


def check(path) -> ModelFolder:
    return load_model_folder(path, IDENTITIES)


def open_one(models: ModelFolder) -> OnnxEngine:
    return OnnxEngine(models, threads=1)


def store(*folders) -> ModelStore:
    return ModelStore(folders, check, open_one, agents=2, candidates=(2, 1))


def opened(models: ModelStore, name: str) -> OnnxEngine:
    """Opens it in a separate thread, since the thread's priority falls."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(models.open, name).result()


def test_a_name_is_looked_for_in_each_folder_in_turn(folders):
    shipped, own = folders
    models = store(*folders)
    assert models.names() == ["both", "first", "v2.1"]
    assert models.find("both") == shipped / "both"
    assert models.find("v2.1") == own / "v2.1"


def test_a_model_is_opened_under_the_name_of_its_folder(folders):
    engine = opened(store(*folders), "v2.1")  # whose manifest says `tiny`
    assert engine.name == "v2.1"
    assert len(engine.graphs) == 2
    assert all(len(sha256) == 64 for sha256 in engine.graphs)
    assert engine.step("male", dummy_inputs(3, 2)).translation.shape == (3, 8, 3)


@pytest.mark.parametrize("name", ["notes", "absent", "first2"])
def test_what_is_no_model_is_not_found(folders, name):
    with pytest.raises(NotFound, match=rf"no model '{name}'; there are both, first, v2.1"):
        opened(store(*folders), name)


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../shipped/first", "/etc", "a/b", "a\\b", ".hidden", "a b", "é", "a" * 65],
)
def test_a_name_is_never_a_path(folders, name):
    with pytest.raises(InvalidArgument, match="allowed: up to 64 letters") as caught:
        opened(store(*folders), name)
    assert caught.value.field == "name"


def test_a_changed_file_is_refused(folders):
    _, own = folders
    graph = own / "v2.1" / "step_male.onnx"
    graph.write_bytes(graph.read_bytes() + b" ")
    with pytest.raises(ArtifactError, match=r"step_male.onnx: sha256: found '\w+', expected '\w+'"):
        opened(store(own), "v2.1")


def test_a_model_for_another_body_is_refused(tmp_path):
    write_folder(tmp_path / "other", **{"hash of male": "hash of somebody"})
    with pytest.raises(ArtifactError, match=r"step_male.onnx: body_sha256: found"):
        opened(store(tmp_path), "other")


def test_a_model_with_a_missing_file_is_refused(folders):
    _, own = folders
    (own / "v2.1" / "step_female.onnx").unlink()
    with pytest.raises(ArtifactError, match=r"step_female.onnx: cannot be read: No such file"):
        opened(store(own), "v2.1")


def test_a_folder_that_is_gone_holds_nothing(folders):
    _, own = folders
    shutil.rmtree(own)
    assert store(*folders).names() == ["both", "first"]
