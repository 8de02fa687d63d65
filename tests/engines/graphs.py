"""Tiny graphs with the inputs and outputs of a real step, for the file formats and the session."""

from pathlib import Path

import numpy as np
import pytest

from wayfarer.engines.engine import LEFT_OUT
from wayfarer.models import artifacts
from wayfarer.models.artifacts import GRAPHS, METADATA_KEY, BodyIdentity
from wayfarer.spec import (
    BETAS,
    LATENT,
    MANNER,
    MARKERS,
    NEW_FRAMES,
    OBSTACLES,
    POSED_JOINTS,
    SEED_FRAMES,
)
from wayfarer.terms import TERMS

onnx = pytest.importorskip("onnx", reason="makes the graphs; the extra `train` brings it")
from onnx import TensorProto, helper, numpy_helper  # noqa: E402  (after the skip)

FLOAT, INT = TensorProto.FLOAT, TensorProto.INT64
NAMES = tuple(f"M{i}" for i in range(MARKERS))
IDENTITIES = {g: BodyIdentity("stick", f"hash of {g}", NAMES) for g in ("male", "female")}

STEP_INPUTS = {
    "seed_markers": ["A", SEED_FRAMES, MARKERS, 3],
    "seed_translation": ["A", SEED_FRAMES, 3],
    "seed_rotations": ["A", SEED_FRAMES, POSED_JOINTS, 4],
    "betas": ["A", BETAS],
    "goal": ["A", 3],
    "target_speed": ["A"],
    "facing": ["A", 2],
    "term_weights": ["A", len(TERMS)],
    "policy": ["A"],
    "noise": ["A", "K", LATENT],
    "manner": ["A", MANNER],
    "obstacles": ["A", OBSTACLES, 7],
}
STEP_OUTPUTS = {
    "translation": ["A", NEW_FRAMES, 3],
    "rotations": ["A", NEW_FRAMES, POSED_JOINTS, 4],
    "contacts": ["A", NEW_FRAMES, 2],
    "next_seed_markers": ["A", SEED_FRAMES, MARKERS, 3],
    "terms": ["A", len(TERMS)],
    "choice": ["A"],
}

UNSCORED_OUTPUTS = {name: shape for name, shape in STEP_OUTPUTS.items() if name not in LEFT_OUT}


def step_model(inputs: dict[str, list] = STEP_INPUTS, outputs: dict[str, list] = STEP_OUTPUTS):
    """translation = last seed frame + target speed · the weight (0.2 along Y); the rest stays."""
    nodes = [
        helper.make_node("Gather", ["seed_translation", "one"], ["last"], axis=1),
        helper.make_node("Unsqueeze", ["target_speed", "axes"], ["speed"]),
        helper.make_node("Mul", ["speed", "way"], ["move"]),
        helper.make_node("Add", ["last", "move"], ["place"]),
        helper.make_node("Expand", ["place", "frames3"], ["translation"]),
        helper.make_node("Gather", ["seed_rotations", "one"], ["turn"], axis=1),
        helper.make_node("Expand", ["turn", "frames22"], ["rotations"]),
        helper.make_node("Mul", ["term_weights", "betas_mean"], ["terms"]),
        helper.make_node("ReduceMean", ["betas"], ["betas_mean"], keepdims=1),
        helper.make_node("Identity", ["seed_markers"], ["next_seed_markers"]),
        helper.make_node("ReduceMax", ["noise", "last_axes"], ["loudest"], keepdims=0),
        helper.make_node("Cast", ["loudest"], ["choice"], to=INT),
        helper.make_node("ReduceMax", ["goal", "axis1"], ["farthest"], keepdims=1),
        helper.make_node("Unsqueeze", ["farthest", "axis2"], ["far"]),
        helper.make_node("Expand", ["far", "frames2"], ["contacts"]),
    ]
    nodes[7], nodes[8] = nodes[8], nodes[7]  # in topological order
    constants = {
        "one": np.array([1]),
        "axes": np.array([1, 2]),
        "axis1": np.array([1]),
        "axis2": np.array([2]),
        "last_axes": np.array([1, 2]),
        "frames3": np.array([1, NEW_FRAMES, 3]),
        "frames22": np.array([1, NEW_FRAMES, POSED_JOINTS, 4]),
        "frames2": np.array([1, NEW_FRAMES, 2]),
    }
    made = set(outputs)
    graph = helper.make_graph(
        [n for n in nodes if n.output[0] not in set(STEP_OUTPUTS) - made],
        "step",
        [helper.make_tensor_value_info(n, FLOAT, s) for n, s in inputs.items()],
        [
            helper.make_tensor_value_info(n, INT if n == "choice" else FLOAT, s)
            for n, s in outputs.items()
        ],
        [numpy_helper.from_array(v.astype(np.int64), n) for n, v in constants.items()],
    )
    way = numpy_helper.from_array(np.array([0, 0.2, 0], np.float32), "way")
    way.ClearField("raw_data")
    way.data_location = TensorProto.EXTERNAL
    for key, value in (("location", "weights.bin"), ("offset", 0), ("length", 12)):
        way.external_data.add(key=key, value=str(value))
    graph.initializer.append(way)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)


def write_folder(path: Path, name: str = "tiny", **changes: str) -> Path:
    """A folder with all step graphs; `changes` are made to each contract's JSON before saving."""
    path.mkdir()
    (path / "weights.bin").write_bytes(np.array([0, 0.2, 0], np.float32).tobytes())
    (path / artifacts.CARD).write_text("# A tiny model\n")
    for file in artifacts.SERVED:
        contract = artifacts.contract_for(file, name, IDENTITIES[GRAPHS[file].gender])
        text = artifacts.contract_to_json(contract)
        for old, new in changes.items():
            text = text.replace(old, new)
        is_scored = GRAPHS[file].kind == "step"
        save(step_model(outputs=STEP_OUTPUTS if is_scored else UNSCORED_OUTPUTS), path / file, text)
    artifacts.write_manifest(path, name, "stick")
    return path


def save(model, path: Path, contract: str | None) -> None:
    del model.metadata_props[:]
    if contract is not None:
        model.metadata_props.add(key=METADATA_KEY, value=contract)
    path.write_bytes(model.SerializeToString())
