"""What ships with the service, checked and opened: bodies, models, start poses; and a world made
of them that runs without a server, on the caller's clock.
"""

from pathlib import Path
from typing import Final

from wayfarer.artifacts import ASSETS, BodyIdentity, ModelFolder, load_model_folder, sha256_of
from wayfarer.body.library import body_file, load_body
from wayfarer.body.model import BodyModel
from wayfarer.runtime.onnx_engine import OnnxEngine
from wayfarer.runtime.settings import Limits, WorldSettings
from wayfarer.runtime.spawn import load_start_poses
from wayfarer.runtime.steering import Steering
from wayfarer.runtime.world import World
from wayfarer.spec import GENDERS

Bodies = dict[str, BodyModel]

BODY: Final = "anny52"
START_POSES: Final = ASSETS / "start_poses.npz"
DEFAULT_MODEL: Final = ASSETS / "models" / "gamma-anny52"


def load_models(path: Path) -> ModelFolder:
    """A motion model's folder, which must be made for the shipped body. Raises ArtifactError."""
    identities = {
        gender: BodyIdentity(
            BODY, sha256_of(body_file(BODY, gender)), load_body(BODY, gender, "low").marker_names
        )
        for gender in GENDERS
    }
    return load_model_folder(path, identities)


def open_world(models: Path, agents: int, candidates: int, threads: int) -> tuple[World, Bodies]:
    """A world for so many agents, who are all stepped at the same moments: in one batch.

    Engine, search and bodies are those of the service. Raises ArtifactError when body, models
    or start poses are missing or do not fit together.
    """
    bodies = {gender: load_body(BODY, gender, "low") for gender in GENDERS}
    settings = WorldSettings(
        limits=Limits(agents=agents, agents_per_session=agents),
        steering=Steering().with_candidates(candidates),
        phases=1,
    )
    engine = OnnxEngine(load_models(models), threads)
    return World(engine, bodies, load_start_poses(START_POSES), settings), bodies
