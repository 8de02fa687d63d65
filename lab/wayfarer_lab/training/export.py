"""Export trained networks to the ONNX graphs that serve. Fails unless torch and ONNX agree."""

import shutil
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime as ort
import torch
from torch import Tensor, nn

from wayfarer.body.library import SHIPPED, body_file, load_body
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import (
    CARD,
    GRAPHS,
    METADATA_KEY,
    BodyIdentity,
    contract_for,
    contract_to_json,
    sha256_of,
    write_manifest,
)
from wayfarer.motion.primitive import PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.spec import GENDERS
from wayfarer_lab.onnx_files import WeightStore, externalise, without_scores
from wayfarer_lab.training.graphs import (
    ExportGraph,
    body_inputs,
    policy_graph,
    predictor_graph,
    regressor_graph,
    step_graph,
    step_inputs,
)
from wayfarer_lab.training.pose_graphs import pose_decoder_graph, pose_encoder_graph
from wayfarer_lab.training.pose_networks import PosePrior
from wayfarer_lab.training.regressor import load_regressor
from wayfarer_lab.training.row_independence import check_rows, make_rows_independent
from wayfarer_lab.training.run import (
    Network,
    load_policy,
    load_predictor,
    load_weights,
    read_run_config,
)

TOLERANCE = 1e-3
"""Largest difference allowed between torch and ONNX: metres for places, unitless for rotations."""


def round_to_half(module: Network) -> Network:
    """Round weights to float16 values in place, as they are shipped."""
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.copy_(parameter.half().float())
    return module.eval()


def to_onnx(graph: ExportGraph) -> onnx.ModelProto:
    """One graph with dynamic leading axes."""
    axes: dict[str, Any] = {}
    for names in graph.batch.values():
        axes |= {n: axes.get(n) or torch.export.Dim(n, min=1, max=1 << 16) for n in names}
    dynamic = tuple({i: axes[n] for i, n in enumerate(graph.batch[name])} for name in graph.inputs)
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # the exporter's own deprecations
        program = torch.onnx.export(
            graph.module,
            tuple(graph.inputs.values()),
            input_names=list(graph.inputs),
            output_names=list(graph.outputs),
            dynamic_shapes=dynamic,
            dynamo=True,
            verbose=False,
        )
    if program is None:
        raise ArtifactError("torch.onnx.export returned no program")
    return program.model_proto


def parity(
    module: nn.Module,
    path: Path,
    inputs: Mapping[str, Tensor],
    outputs: Sequence[str],
    freaks: float = 0.0,
) -> float:
    """Largest difference between torch and the graph in `path` over rows that chose alike.

    The share `freaks` of the rows that differ most is left out: where inputs are no bodies, one of
    them may lie where a rotation is ill-conditioned, and the last digit decides.
    Raises ArtifactError above `TOLERANCE`, or when more than one row, and one in a hundred, chose
    another candidate (two candidates may cost the same to the last digit).
    """
    session = ort.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    got = session.run(list(outputs), {n: v.numpy() for n, v in inputs.items()})
    with torch.no_grad():
        expected = module(*inputs.values())
    expected = [e.numpy() for e in (expected if isinstance(expected, tuple) else (expected,))]
    same = np.ones(len(got[0]), dtype=bool)
    if "choice" in outputs:
        at = list(outputs).index("choice")
        same = got[at] == expected[at]
        if np.count_nonzero(~same) > max(1, 0.01 * len(same)):
            raise ArtifactError(
                f"{path.name}: torch and ONNX choose alike in only {same.mean():.1%} of rows"
            )
    off = np.zeros(int(same.sum()))
    for name, a, b in zip(outputs, expected, got, strict=True):
        if not np.isfinite(b).all():
            raise ArtifactError(f"{path.name}: output {name} holds values that are not finite")
        off = np.maximum(off, np.abs(a[same] - b[same]).reshape(len(off), -1).max(1))
    worst = float(np.quantile(off, 1 - freaks, method="lower"))
    if worst > TOLERANCE:
        raise ArtifactError(
            f"{path.name}: torch and ONNX differ by {worst:.2e}, allowed {TOLERANCE:.0e}"
        )
    return worst


def save_graph(graph: ExportGraph, path: Path, store: WeightStore, contract: str) -> None:
    """Writes one graph; its weights go to the store, its contract (JSON) into the metadata."""
    model = externalise(make_rows_independent(to_onnx(graph)), store)
    for node in model.graph.node:
        del node.metadata_props[:]  # stack traces of the exporter: a megabyte of them
        node.doc_string = ""
    write_graph(model, path, contract)


def write_graph(model: onnx.ModelProto, path: Path, contract: str) -> None:
    """Writes one graph, whose weights are in its folder's store, with its contract."""
    del model.metadata_props[:]
    model.metadata_props.add(key=METADATA_KEY, value=contract)
    path.write_bytes(model.SerializeToString())


@dataclass(frozen=True)
class Sources:
    """Run folders that hold the weights of each network."""

    predictor_1f: Path
    predictor_2f: Path
    policy: Path
    regressor_male: Path
    regressor_female: Path
    pose_prior: Path


def load_graphs(sources: Sources, body: str) -> dict[str, ExportGraph]:
    """Every graph of a model folder by file name, from trained weights (rounded as shipped).

    The step canonicalises as its predictor was trained (`floor_origin` of that run).
    """
    floor_origin = read_run_config(sources.predictor_2f)["floor_origin"]
    one = round_to_half(load_predictor(sources.predictor_1f, 1))
    two = round_to_half(load_predictor(sources.predictor_2f, 2))
    for predictor in (one, two):
        predictor.uses_prior = predictor.has_learned_prior
    policy = round_to_half(load_policy(sources.policy))
    prior = round_to_half(load_weights(PosePrior(), sources.pose_prior))
    graphs = {
        "predictor_1f.onnx": predictor_graph(one),
        "predictor_2f.onnx": predictor_graph(two),
        "policy.onnx": policy_graph(policy),
        "pose_encoder.onnx": pose_encoder_graph(prior),
        "pose_decoder.onnx": pose_decoder_graph(prior),
    }
    for gender in GENDERS:
        model = load_body(body, gender)
        run = getattr(sources, f"regressor_{gender}")
        body_of = marker_body(model)
        regressor = round_to_half(load_regressor(body_of, run))
        sites = Sites.from_names(model.marker_names)
        step = PrimitiveStep(two, regressor, body_of, sites, policy, floor_origin).eval()
        graphs[f"regressor_{gender}.onnx"] = regressor_graph(regressor)
        graphs[f"step_{gender}.onnx"] = step_graph(step)
    return graphs


def export_models(
    sources: Sources,
    out: Path,
    card: str,
    name: str = "gamma-anny52",
) -> dict[str, float]:
    """Writes a model folder from trained weights; see `load_graphs` and `write_models`."""
    floor_origin = bool(read_run_config(sources.predictor_2f)["floor_origin"])
    graphs = load_graphs(sources, SHIPPED)
    return write_models(graphs, out, card, name, SHIPPED, floor_origin)


def write_models(
    graphs: Mapping[str, ExportGraph],
    out: Path,
    card: str,
    name: str,
    body: str = "anny52",
    floor_origin: bool = True,
) -> dict[str, float]:
    """Writes graphs, by file name, as a model folder; returns each one's torch-ONNX difference.

    The folder is written beside its place and moved there only when every graph agrees with torch
    on random inputs; step graphs also on standing and on moving bodies.
    """
    staging = out.with_name(out.name + ".new")
    shutil.rmtree(staging, ignore_errors=True)
    staging.mkdir(parents=True)
    store = WeightStore()

    def contract(file: str) -> str:
        whose = identity(body, GRAPHS[file].gender or GENDERS[0])
        return contract_to_json(contract_for(file, name, whose, floor_origin))

    for file, graph in graphs.items():
        save_graph(graph, staging / file, store, contract(file))
    store.write(staging)
    differences = {file: check_graph(staging / file, graph) for file, graph in graphs.items()}
    for file in (each for each in graphs if GRAPHS[each].kind == "step"):
        scored, silent = staging / file, staging / file.replace("step", "unscored")
        model = onnx.load(scored, load_external_data=False)
        write_graph(without_scores(model), silent, contract(silent.name))
        check_unscored(scored, silent)
    (staging / CARD).write_text(card)
    write_manifest(staging, name, body)
    shutil.rmtree(out, ignore_errors=True)
    staging.rename(out)
    return differences


def check_graph(path: Path, graph: ExportGraph) -> float:
    """Parity on the example inputs and, for steps, over batch sizes, candidates and real bodies.

    Rows of a step must not depend on their batch.
    """
    worst = parity(graph.module, path, graph.inputs, graph.outputs)
    if isinstance(graph.module, PrimitiveStep):
        generator = torch.Generator().manual_seed(1)
        for agents, candidates in ((1, 1), (7, 3), (256, 4)):
            inputs = step_inputs(agents, candidates, generator)
            worst = max(worst, parity(graph.module, path, inputs, graph.outputs, freaks=0.01))
            inputs |= body_inputs(graph.module, agents, generator)
            worst = max(worst, parity(graph.module, path, inputs, graph.outputs))
            if agents < 64:  # smaller batches of all rows take their time
                check_rows(path, {name: values.numpy() for name, values in inputs.items()})
    return worst


def check_unscored(scored: Path, silent: Path) -> None:
    """Raises ArtifactError unless both graphs move one candidate alike, bit for bit."""
    inputs = step_inputs(7, 1, torch.Generator().manual_seed(1))
    given = {name: values.numpy() for name, values in inputs.items()}
    one, other = (ort.InferenceSession(str(path)) for path in (scored, silent))
    names = [output.name for output in other.get_outputs()]
    for name, a, b in zip(names, one.run(names, given), other.run(names, given), strict=True):
        if not np.array_equal(a, b):
            raise ArtifactError(f"{silent.name}: output {name} differs from {scored.name}'s")


def identity(body: str, gender: str) -> BodyIdentity:
    """The identity of a shipped body in contracts."""
    return BodyIdentity(
        body, sha256_of(body_file(body, gender)), load_body(body, gender).marker_names
    )
