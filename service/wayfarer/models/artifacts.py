"""Model folders: their files, the contract that each graph carries, and the check at load.

    assets/models/<name>/
        manifest.json          name, body, card, SHA-256 of every other file
        step_male.onnx         the whole step, one graph per gender (what the service runs)
        step_female.onnx
        unscored_{male,female}.onnx
                               the same steps for one candidate, without terms and choice
        predictor_{1f,2f}.onnx, policy.onnx, regressor_{male,female}.onnx
                               the parts, for other engines
    pose_encoder.onnx, pose_decoder.onnx
                               the pose prior (VPoser's role), for evaluation and other tools
        weights.bin            external data, shared by the graphs
        CARD.md                model card

A graph's `metadata_props` hold its contract as JSON under the key `wayfarer`. The exporter
writes contract and manifest with the functions here, so they are defined once. Loading fails
with `ArtifactError`, which names file, field, what was found and what was expected.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Final

import onnxruntime

from wayfarer import spec
from wayfarer.errors import ArtifactError
from wayfarer.models.onnx_metadata import read_metadata
from wayfarer.terms import TERMS

ASSETS: Final = Path(__file__).parents[1] / "assets"
"""The shipped body, models and start poses."""

SCHEMA: Final = 1
METADATA_KEY: Final = "wayfarer"
MANIFEST: Final = "manifest.json"
CARD: Final = "CARD.md"


@dataclass(frozen=True, slots=True)
class Graph:
    """The kind, gender and seed length of a file of the folder."""

    kind: str  # the file's name without gender and seed length
    gender: str = ""  # "" when the graph serves both
    seed_frames: int = 0  # 0 when the graph takes single frames


GRAPHS: Final[Mapping[str, Graph]] = {
    "step_male.onnx": Graph("step", "male", spec.SEED_FRAMES),
    "step_female.onnx": Graph("step", "female", spec.SEED_FRAMES),
    "unscored_male.onnx": Graph("unscored", "male", spec.SEED_FRAMES),
    "unscored_female.onnx": Graph("unscored", "female", spec.SEED_FRAMES),
    "predictor_1f.onnx": Graph("predictor", "", 1),
    "predictor_2f.onnx": Graph("predictor", "", 2),
    "policy.onnx": Graph("policy", "", spec.SEED_FRAMES),
    "regressor_male.onnx": Graph("regressor", "male"),
    "regressor_female.onnx": Graph("regressor", "female"),
    "pose_encoder.onnx": Graph("pose_encoder"),
    "pose_decoder.onnx": Graph("pose_decoder"),
}
"""Every graph that a folder may hold."""

SERVED: Final = (
    *("step_male.onnx", "step_female.onnx"),
    *("unscored_male.onnx", "unscored_female.onnx"),
)
"""The graphs that the service needs."""


@dataclass(frozen=True, slots=True)
class BodyIdentity:
    """The properties of one body of one gender that a graph depends on."""

    body: str  # "anny52"
    sha256: str  # of the body's file; "" for graphs that skin no body
    marker_names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Contract:
    """The values a graph was exported for. Field order is the order in the JSON."""

    schema: int
    kind: str
    model: str
    fps: int
    primitive_frames: int
    seed_frames: int
    markers: int
    marker_names_sha256: str
    latent: int
    manner: int
    betas: int
    body: str
    gender: str
    body_sha256: str
    floor_origin: bool  # the canonical frame's origin: the floor under the hips, or the hips
    terms: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ModelFolder:
    """A model folder whose files and contracts have been checked."""

    name: str
    path: Path
    body: str
    card: Path
    contracts: Mapping[str, Contract]  # by file name

    def graph(self, kind: str, gender: str = "", seed_frames: int = 0) -> Path:
        """Path of a graph. Raises ArtifactError when the folder does not hold it."""
        wanted = Graph(kind, gender, seed_frames)
        for name in self.contracts:
            if GRAPHS[name] == wanted:
                return self.path / name
        raise ArtifactError(f"{self.path}: holds no {wanted}; it holds {sorted(self.contracts)}")


def sha256_of(path: Path) -> str:
    """Hex SHA-256 of a file. Raises ArtifactError when it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ArtifactError(f"{path}: cannot be read: {error.strerror}") from error


def names_sha256(names: Iterable[str]) -> str:
    """Hex SHA-256 of names in order, one per line: equal only for equal order."""
    return hashlib.sha256("\n".join(names).encode()).hexdigest()


def contract_for(file: str, model: str, body: BodyIdentity, floor_origin: bool = True) -> Contract:
    """The contract that this version of the project writes and expects for a graph file."""
    graph = GRAPHS[file]
    return Contract(
        schema=SCHEMA,
        kind=graph.kind,
        model=model,
        fps=spec.FPS,
        primitive_frames=spec.PRIMITIVE_FRAMES,
        seed_frames=graph.seed_frames,
        markers=spec.MARKERS,
        marker_names_sha256=names_sha256(body.marker_names),
        latent=spec.LATENT,
        manner=spec.MANNER,
        betas=spec.BETAS,
        body=body.body,
        gender=graph.gender,
        body_sha256=body.sha256 if graph.gender else "",
        floor_origin=floor_origin,
        terms=TERMS if graph.kind == "step" else (),
    )


def contract_to_json(contract: Contract) -> str:
    """The text that goes into `metadata_props["wayfarer"]`."""
    return json.dumps(asdict(contract))


def contract_from_json(text: str, where: str) -> Contract:
    """Reads a contract; `where` opens the error messages. Raises ArtifactError."""
    values = _json_object(text, f"{where}: metadata {METADATA_KEY!r}")
    cure = ": is it of another build? Export its training runs again with `wayfarer export`"
    names = [f.name for f in fields(Contract)]
    _same_keys(values, names, f"{where}: metadata {METADATA_KEY!r}", cure)
    if not isinstance(values["floor_origin"], bool):
        raise ArtifactError(
            f"{where}: floor_origin: found {values['floor_origin']!r}, expected true or false"
        )
    if not isinstance(values["terms"], list):
        raise ArtifactError(f"{where}: terms: found {values['terms']!r}, expected a list of names")
    return Contract(**{**values, "terms": tuple(values["terms"])})


def write_manifest(path: Path, name: str, body: str) -> None:
    """Writes `manifest.json` over all files now in the folder. Raises ArtifactError."""
    files = {p.name: sha256_of(p) for p in sorted(path.iterdir()) if p.name != MANIFEST}
    manifest = {"schema": SCHEMA, "name": name, "files": files, "body": body, "card": CARD}
    (path / MANIFEST).write_text(json.dumps(manifest, indent=2) + "\n")


def load_model_folder(
    path: Path, bodies: Mapping[str, BodyIdentity], required: Iterable[str] = SERVED
) -> ModelFolder:
    """Checks a model folder: every file's hash, and every graph's contract.

    Args:
        path: the folder.
        bodies: the bodies that will be used, by gender.
        required: graph files that must be there.

    Raises:
        ArtifactError: names file, field, found and expected.
    """
    manifest, manifest_path = _manifest(path), path / MANIFEST
    for body in bodies.values():
        _expect(f"{manifest_path}: body", manifest["body"], body.body)
    _check_files(path, manifest, required)

    contracts = {}
    for file in sorted(f for f in manifest["files"] if f.endswith(".onnx")):
        if file not in GRAPHS:
            raise ArtifactError(f"{manifest_path}: files: found {file}, expected {sorted(GRAPHS)}")
        contracts[file] = read_contract(path / file)
        _check_contract(path / file, contracts[file], manifest["name"], bodies)
    return ModelFolder(
        name=manifest["name"],
        path=path,
        body=manifest["body"],
        card=path / manifest["card"],
        contracts=contracts,
    )


def body_name(path: Path) -> str:
    """The body that a model folder's manifest names. Raises ArtifactError."""
    return str(_manifest(path)["body"])


def read_contract(path: Path) -> Contract:
    """The contract inside a graph file. Raises ArtifactError."""
    try:
        metadata = read_metadata(path)
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: cannot be read: {error}") from error
    if METADATA_KEY not in metadata:
        raise ArtifactError(
            f"{path}: metadata: found keys {sorted(metadata)}, expected {METADATA_KEY!r}"
        )
    return contract_from_json(metadata[METADATA_KEY], str(path))


def open_session(path: Path, options: onnxruntime.SessionOptions) -> onnxruntime.InferenceSession:
    """Opens a graph on the CPU. Raises ArtifactError when onnxruntime refuses it."""
    try:
        return onnxruntime.InferenceSession(
            str(path), sess_options=options, providers=["CPUExecutionProvider"]
        )
    except Exception as error:  # onnxruntime's own classes share no public base but Exception
        raise ArtifactError(f"{path}: onnxruntime cannot open it: {error}") from error


def _check_files(path: Path, manifest: dict[str, Any], required: Iterable[str]) -> None:
    where = path / MANIFEST
    files = manifest["files"]
    if not isinstance(files, dict):
        raise ArtifactError(f"{where}: files: found {files!r}, expected an object of hashes")
    for file in (*required, manifest["card"]):
        if file not in files:
            raise ArtifactError(f"{where}: files: {file} is missing; found {sorted(files)}")
    for file, expected in files.items():
        if Path(file).name != file:
            raise ArtifactError(f"{where}: files: found {file!r}, expected a plain file name")
        _expect(f"{path / file}: sha256", sha256_of(path / file), expected)


def _check_contract(
    path: Path, found: Contract, model: str, bodies: Mapping[str, BodyIdentity]
) -> None:
    gender = GRAPHS[path.name].gender
    if gender and gender not in bodies:
        raise ArtifactError(f"{path}: gender: found {gender!r}, expected {sorted(bodies)}")
    # A graph for both genders skins no body: any of them names the same markers.
    body = bodies[gender] if gender else next(iter(bodies.values()))
    wanted = contract_for(path.name, model, body, found.floor_origin)
    for name, expected in asdict(wanted).items():
        _expect(f"{path}: {name}", getattr(found, name), expected)


def _expect(what: str, found: object, expected: object) -> None:
    if found != expected:
        raise ArtifactError(f"{what}: found {found!r}, expected {expected!r}")


def _manifest(path: Path) -> dict[str, Any]:
    """The manifest of a model folder. Raises ArtifactError."""
    file = path / MANIFEST
    try:
        text = file.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise ArtifactError(f"{file}: cannot be read: {error}") from error
    manifest = _json_object(text, str(file))
    _same_keys(manifest, ["schema", "name", "files", "body", "card"], str(file))
    _expect(f"{file}: schema", manifest["schema"], SCHEMA)
    return manifest


def _json_object(text: str, where: str) -> dict[str, Any]:
    try:
        value = json.loads(text)
    except ValueError as error:
        raise ArtifactError(f"{where}: is not JSON: {error}") from error
    if not isinstance(value, dict):
        raise ArtifactError(f"{where}: found {type(value).__name__}, expected a JSON object")
    return value


def _same_keys(values: dict[str, Any], expected: list[str], where: str, cure: str = "") -> None:
    if set(values) != set(expected):
        found = f"found fields {sorted(values)}, expected {sorted(expected)}"
        raise ArtifactError(f"{where}: {found}{cure}")
