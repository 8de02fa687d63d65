"""A model folder of GAMMA-release's networks, on the user's own SMPL-X body with MOJO's markers.

The recursion around the networks is ours (`motion/primitive.py`), set to what the paper has: the
canonical frame at the hips, every frame regressed, markers averaged. Such a frame does not know the
floor, so bodies would float off or sink over minutes: unless asked for the paper's recursion alone,
the step takes a part of the height off, as ours does. SSM2 has nothing under the feet; contact and
height are those of the skin there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wayfarer.body.landmarks import AROUND_SOLE
from wayfarer.body.library import SMPLX_FOLDER, body_file, load_body
from wayfarer.body.model import BodyModel
from wayfarer.engines.torch.marker_bodies import marker_body
from wayfarer.errors import ArtifactError
from wayfarer.motion.primitive import GROUNDING, PrimitiveStep
from wayfarer.motion.quality import Sites
from wayfarer.spec import GENDERS
from wayfarer_lab.gamma.convert import load_policy, load_predictor, load_regressor
from wayfarer_lab.gamma.networks import PASSES
from wayfarer_lab.training.export import round_to_half, write_models
from wayfarer_lab.training.graphs import (
    ExportGraph,
    policy_graph,
    predictor_graph,
    regressor_graph,
    step_graph,
)
from wayfarer_lab.training.smpl_joints import load_joints

BODY = "smplx"


@dataclass(frozen=True)
class Checkpoints:
    """The files of one release, as `wayfarer import gamma` names them."""

    predictor_1f: Path
    predictor_2f: Path
    policy: Path
    regressor_male: Path
    regressor_female: Path


def ssm2_sites(names: Sequence[str]) -> Sites:
    """The sites of the quality terms among MOJO's SSM2 markers. Raises ArtifactError."""

    def find(*wanted: str) -> list[int]:
        missing = [w for w in wanted if w not in names]
        if missing:
            raise ArtifactError(
                f"the body lacks markers {missing}: GAMMA's networks need the 67 of SSM2.json; "
                f"copy that file as markers.json into the folder of {SMPLX_FOLDER}"
            )
        return [list(names).index(w) for w in wanted]

    reaching = ("SHO", "ELB", "FIN", "THI", "KNE", "TOE")
    return Sites(
        left_waist=find("LFWT", "LBWT"),
        right_waist=find("RFWT", "RBWT"),
        chest=find("C7", "CLAV"),
        # before a body is known, these stand for the soles, 1 to 3 cm above them
        left_sole=find(*("L" + name for name in AROUND_SOLE)),
        right_sole=find(*("R" + name for name in AROUND_SOLE)),
        left_ankle=find("LANK")[0],
        right_ankle=find("RANK")[0],
        outline=find(*(side + name for side in "LR" for name in reaching)),
    )


def gamma_graphs(
    files: Checkpoints, passes: int = PASSES, grounding: float = GROUNDING
) -> dict[str, ExportGraph]:
    """Every graph of the model folder by file name. Raises ArtifactError, NotFound.

    `grounding`: share of a primitive's height error that is taken off; 0, as in the paper: none.
    """
    one = round_to_half(load_predictor(files.predictor_1f, 1))
    two = round_to_half(load_predictor(files.predictor_2f, 2))
    policy: Any = round_to_half(load_policy(files.policy))  # in a policy's place, not its subclass
    graphs = {
        "predictor_1f.onnx": predictor_graph(one),
        "predictor_2f.onnx": predictor_graph(two),
        "policy.onnx": policy_graph(policy),
    }
    for gender in GENDERS:
        body: BodyModel = load_body(BODY, gender)
        joints = load_joints(body_file(BODY, gender), "smplx")
        path = getattr(files, f"regressor_{gender}")
        regressor: Any = round_to_half(load_regressor(path, joints, passes))
        step = PrimitiveStep(
            two,
            regressor,
            marker_body(body),
            ssm2_sites(body.marker_names),
            policy,
            floor_origin=False,
            grounding=grounding,
            every=1,
            soles=marker_body(body, body.sole_vertices.tolist()),
        ).eval()
        graphs[f"regressor_{gender}.onnx"] = regressor_graph(regressor)
        graphs[f"step_{gender}.onnx"] = step_graph(step)
    return graphs


def import_gamma(
    files: Checkpoints, out: Path, passes: int = PASSES, grounding: float = GROUNDING
) -> dict[str, float]:
    """Writes the model folder; returns each graph's torch-ONNX difference. See `gamma_graphs`."""
    graphs = gamma_graphs(files, passes, grounding)
    return write_models(graphs, out, _card(out.name, files), out.name, BODY, floor_origin=False)


def _card(name: str, files: Checkpoints) -> str:
    rows = "\n".join(f"- {field}: `{Path(path).name}`" for field, path in vars(files).items())
    return (
        f"# {name}\n\nNetworks of GAMMA-release (Zhang and Tang, CVPR 2022), imported with "
        f"`wayfarer import gamma` from\n\n{rows}\n\nWeights were trained on AMASS: they are for "
        "research only, under the licences of AMASS and SMPL-X. What differs from the authors' own "
        "program: docs/models.md.\n"
    )
