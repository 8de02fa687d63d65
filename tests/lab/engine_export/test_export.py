"""`wayfarer export --for engines`, seen from a host that knows only the written folder."""

import json
from hashlib import sha256
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper

from wayfarer.engines.onnx_engine import OnnxEngine
from wayfarer.errors import ArtifactError, InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL, START_POSES, load_bodies, load_models
from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer.terms import TERMS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.goals.steering import Steering
from wayfarer_lab.engine_export import export as exporter
from wayfarer_lab.engine_export.export import _Walk, export_for_engines
from wayfarer_lab.engine_export.graph import engine_graph, operators
from wayfarer_lab.engine_export.operators import check_operators
from wayfarer_lab.export_command import ExportTarget, export

GENDERS = ("female", "male")


@pytest.fixture(scope="module")
def written(engines_export):
    assert "step_female.onnx: differs from onnxruntime by" in engines_export.said
    assert "torch" not in engines_export.said
    return engines_export.folder


@pytest.fixture(scope="module")
def about(written):
    return json.loads((written / "wayfarer.json").read_text())


def opened(path: Path) -> onnxruntime.InferenceSession:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def parts(written: Path, about: dict, gender: str) -> dict[str, np.ndarray]:
    """The tensors of a body's file, as its sidecar lays them out."""
    layout = about["bodies"][gender]
    data = (written / layout["file"]).read_bytes()
    return {
        part["name"]: np.frombuffer(data[part["offset"] :][: part["bytes"]], "<f4").reshape(
            part["shape"]
        )
        for part in layout["parts"]
    }


def test_files_are_those_that_the_sidecar_names(written, about):
    assert {path.name for path in written.iterdir()} == {
        *about["files"],
        "wayfarer.json",
        "README.md",
    }
    for name, entry in about["files"].items():
        data = (written / name).read_bytes()
        assert (len(data), sha256(data).hexdigest()) == (entry["bytes"], entry["sha256"])


@pytest.mark.parametrize("gender", GENDERS)
def test_graphs_stand_alone_and_are_as_documented(written, about, gender, tmp_path):
    alone = tmp_path / "alone.onnx"  # in a folder without weights
    alone.write_bytes((written / f"step_{gender}.onnx").read_bytes())
    model = onnx.load(alone)
    onnx.checker.check_model(model, full_check=True)
    assert model.ir_version == about["ir_version"] == 8
    assert (
        [(o.domain, o.version) for o in model.opset_import] == [("", about["opset"])] == [("", 15)]
    )
    assert not any(tensor.data_type == TensorProto.FLOAT16 for tensor in model.graph.initializer)
    assert operators(model) == about["operators"]
    session = opened(alone)
    for values, told in (
        (session.get_inputs(), about["inputs"]),
        (session.get_outputs(), about["outputs"]),
    ):
        assert [(v.name, v.shape, v.type) for v in values] == [
            (t["name"], t["shape"], "tensor(float)") for t in told
        ]
    assert [i.shape for i in session.get_inputs() if i.name == "noise"] == [["agents", 1, 128]]
    assert not {"terms", "choice"} & {o.name for o in session.get_outputs()}


def test_a_host_that_follows_the_page_gets_the_servers_motion(written, about):
    """Recursion from a start pose of the body's file, 40 steps: the same bits as the engine's."""
    gender, noise_seed, heading = "female", 5, 0.7
    betas = np.linspace(-1, 1, 10).astype(np.float32)
    own = parts(written, about, gender)
    markers = own["start_markers"][noise_seed] + own["start_markers_dirs"][noise_seed] @ betas
    cos, sin = np.cos(heading), np.sin(heading)
    markers = markers @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    soles = np.ravel(about["sole_markers"])
    hips = np.array([1.0, 2.0, -markers[soles, 2].min()])
    x, y, z, w = own["start_rotations"][noise_seed][0]
    s, c = np.sin(heading / 2), np.cos(heading / 2)
    turns = own["start_rotations"][noise_seed].copy()
    turns[0] = c * x - s * y, c * y + s * x, c * z + s * w, c * w - s * z

    spawner = Spawner(load_bodies("anny52"), load_start_poses(START_POSES))
    spec = AgentSpec(gender, tuple(betas.tolist()), (1.0, 2.0), heading, noise_seed)
    served = spawner.stand(spec).seed
    for found, expected in (
        (markers + hips, served.markers[0]),
        (hips, served.translation[0]),
        (turns, served.rotations[0]),
    ):
        np.testing.assert_allclose(np.stack([found, found]), expected, atol=1e-6)

    session, engine = (
        opened(written / "step_female.onnx"),
        OnnxEngine(load_models(DEFAULT_MODEL), 1),
    )
    walking = about["modes"]["WALKING"]
    inputs = {
        "seed_markers": served.markers,
        "seed_translation": served.translation,
        "seed_rotations": served.rotations,
        "betas": betas[None],
        "goal": np.array([[1.0, 30.0, 0.0]], np.float32),
        "target_speed": np.array([1.2], np.float32),
        "facing": np.zeros((1, 2), np.float32),
        "term_weights": np.array([walking["term_weights"]], np.float32),
        "policy": np.array([walking["policy"]], np.float32),
        "noise": np.zeros((1, 1, 128), np.float32),
        "manner": np.zeros((1, 8), np.float32),
    }
    names = [o.name for o in session.get_outputs()]
    for _ in range(40):
        needed = {i.name: inputs[i.name] for i in session.get_inputs()}
        out = dict(zip(names, session.run(names, needed), strict=True))
        step = exporter_inputs(inputs)
        expected = engine.step(gender, step)
        for name in names:
            np.testing.assert_array_equal(out[name], getattr(expected, name))
        inputs |= {
            "seed_markers": out["next_seed_markers"],
            "seed_translation": out["translation"][:, -2:],
            "seed_rotations": out["rotations"][:, -2:],
        }
    way = out["translation"][0, -1, :2] - served.translation[0, -1, :2]
    assert 7 < np.linalg.norm(way) < 40 * NEW_FRAMES / FPS * 1.6  # it walks


def exporter_inputs(inputs):
    from wayfarer.engines.engine import StepInputs, no_obstacles

    return StepInputs(**{"obstacles": no_obstacles(1), **inputs})


def test_the_sidecar_has_the_servers_constants(about):
    steering = Steering()
    for name, entry in about["steering"].items():
        assert entry["value"] == getattr(steering, name) and entry["meaning"]
    for mode, search in steering.searches.items():
        told = dict(zip(TERMS, about["modes"][mode.name]["term_weights"], strict=True))
        assert {term: w for term, w in told.items() if w} == dict(search.weights)


def test_the_page_names_everything(written, about):
    page = (written / "README.md").read_text()
    for tensor in (*about["inputs"], *about["outputs"]):
        assert f"| `{tensor['name']}` | {' × '.join(map(str, tensor['shape']))} |" in page
    for name in (*about["steering"], *about["files"], *about["bodies"]["male"]["parts"][0]):
        assert name in page or name in (
            "dtype",
            "bytes",
            "name",
            "shape",
            "offset",
            "meaning",
            "unit",
        )
    assert "{" not in page


def test_torch_agrees(written):
    pytest.importorskip("torch")
    folder = load_models(DEFAULT_MODEL)
    engine = exporter._served(folder)["torch"]
    poses = load_start_poses(START_POSES)[:4]
    walk = _Walk(load_bodies("anny52"), poses, "male", Steering().with_search(1), 1)
    assert 0 < walk.compared(written / "step_male.onnx", engine) < exporter.TOLERANCE
    with pytest.raises(ArtifactError, match="differs from gamma-anny52 by"):
        walk.compared(written / "step_female.onnx", engine)


def test_several_candidates_keep_the_choice_inside():
    source = DEFAULT_MODEL / "step_female.onnx"
    model = engine_graph(source, 3, {})
    check_operators(model, "three")
    names = [value.name for value in model.graph.input]
    assert "obstacles" in names and "ArgMin" in operators(model)
    rng = np.random.default_rng(0)
    values = {
        "seed_rotations": np.tile(np.float32([0, 0, 0, 1]), (2, 2, 22, 1)),
        "noise": rng.normal(size=(2, 3, 128)).astype(np.float32),
        "obstacles": np.full((2, 8, 7), -1, np.float32),
    }
    for value in model.graph.input:
        sizes = [d.dim_value or 2 for d in value.type.tensor_type.shape.dim]
        values.setdefault(value.name, rng.normal(size=sizes).astype(np.float32))
    session = onnxruntime.InferenceSession(model.SerializeToString())
    outputs = [o.name for o in session.get_outputs()]
    expected = opened(source).run(outputs, values)
    for found, wanted in zip(session.run(outputs, values), expected, strict=True):
        np.testing.assert_array_equal(found, wanted)


def test_an_operator_that_unity_lacks_is_named():
    value = helper.make_tensor_value_info("x", TensorProto.FLOAT, [2, 2])
    out = helper.make_tensor_value_info("y", TensorProto.FLOAT, [2, 2])
    node = helper.make_node("Einsum", ["x", "x"], ["y"], equation="ij,jk->ik")
    model = helper.make_model(helper.make_graph([node], "g", [value], [out]))
    with pytest.raises(ArtifactError, match=r"made\.onnx: Unity's Inference Engine has no Einsum"):
        check_operators(model, "made.onnx")
    custom = helper.make_node("Gelu", ["x"], ["y"], domain="com.microsoft")
    model = helper.make_model(helper.make_graph([custom], "g", [value], [out]))
    with pytest.raises(ArtifactError, match=r"domains \['com.microsoft'\]"):
        check_operators(model, "made.onnx")


def test_nobodys_files_are_lost(written, tmp_path, monkeypatch):
    """If a check fails, the earlier export stays, with the files that Unity adds."""
    out = tmp_path / "made"
    out.mkdir()
    for name in ("wayfarer.json", "README.md"):
        (out / name).write_bytes((written / name).read_bytes())
    (out / "step_male.onnx.meta").write_text("guid: 1")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    monkeypatch.setattr(exporter, "engine_graph", lambda *_: helper.make_model(
        helper.make_graph([helper.make_node("Relu", ["x"], ["y"])], "g", [], [])))  # fmt: skip
    with pytest.raises(onnx.checker.ValidationError):
        export_for_engines(DEFAULT_MODEL, out, 1, lambda _: None)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_foreign_folders_are_refused(tmp_path):
    (tmp_path / "README.md").write_text("mine")
    with pytest.raises(InvalidArgument, match=r"holds README\.md, and no earlier export"):
        export_for_engines(DEFAULT_MODEL, tmp_path, 1, print)
    with pytest.raises(InvalidArgument, match="is a file; name a folder"):
        export_for_engines(DEFAULT_MODEL, tmp_path / "README.md", 1, print)
    with pytest.raises(ArtifactError, match=r"manifest\.json: cannot be read"):
        export_for_engines(tmp_path, tmp_path / "out", 1, lambda _: None)
    assert (tmp_path / "README.md").read_text() == "mine" and not (tmp_path / "out").exists()


def test_options_of_the_other_target_are_refused():
    with pytest.raises(
        InvalidArgument, match="--policy is for --for server; this is --for engines"
    ):
        export(target=ExportTarget.ENGINES, policy="mine")
    with pytest.raises(InvalidArgument, match="--candidates is for --for engines or web"):
        export(target=ExportTarget.SERVER, candidates=2)


def test_for_web_the_graphs_share_halves_of_weights(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(
        exporter, "export_for_engines", lambda *given, **how: asked.append((given[:3], how))
    )
    export(target=ExportTarget.WEB, out=tmp_path)
    assert asked == [((DEFAULT_MODEL, tmp_path, 1), {"halves": True})]
