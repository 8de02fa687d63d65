"""The data that ships with the service, checked and opened: bodies, models and start poses. A world
made of them runs without a server, on the caller's clock.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from wayfarer.body import landmarks
from wayfarer.body.library import SMPLX_FOLDER, body_file, load_body
from wayfarer.body.model import BodyModel
from wayfarer.config.limits import Limits
from wayfarer.engines.choice import open_engine
from wayfarer.engines.engine import EngineKind
from wayfarer.engines.warm import WarmEngine
from wayfarer.errors import ArtifactError, NotFound
from wayfarer.models.artifacts import (
    ASSETS,
    BodyIdentity,
    ModelFolder,
    body_name,
    load_model_folder,
    sha256_of,
)
from wayfarer.spec import GENDERS
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.prepare import prepare
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.rules import ActingRules
from wayfarer.world.stepping.settings import ANY_SIZE, WorldSettings
from wayfarer.world.world import World

Bodies = dict[str, BodyModel]

START_POSES: Final = ASSETS / "start_poses.npz"
DEFAULT_MODEL: Final = ASSETS / "models" / "gamma-anny52"


def load_models(path: Path, body: str = "") -> ModelFolder:
    """A motion model's folder, checked against the `body` that it must be made for.

    By default that is the body that the folder's manifest names. Raises ArtifactError.
    """
    body = body or body_name(path)
    try:
        bodies = load_bodies(body)
    except NotFound as error:
        raise ArtifactError(f"{path}: its body cannot be used: {error}") from error
    identities = {
        gender: BodyIdentity(body, sha256_of(body_file(body, gender)), found.marker_names)
        for gender, found in bodies.items()
    }
    return load_model_folder(path, identities)


def load_bodies(name: str) -> Bodies:
    """The bodies of a name, by gender, with few vertices.

    Raises NotFound, and ArtifactError for a body whose feet cannot be found: worlds lock them.
    """
    bodies = {gender: load_body(name, gender, "low") for gender in GENDERS}
    for gender, body in bodies.items():
        try:
            soles = len(body.sole_vertices)
        except ValueError as error:
            raise ArtifactError(f"body {name} ({gender}) has no soles: {error}") from error
        if soles != len(body.sole_markers):
            raise ArtifactError(
                f"body {name} ({gender}) lacks markers of the feet, which a server needs: "
                f"{[s + m for s in 'LR' for m in landmarks.AROUND_SOLE]}; take away the "
                f"markers.json in {SMPLX_FOLDER}, and ours are found by geometry"
            )
    return bodies


@dataclass(frozen=True)
class ModelBundle:
    """A motion model, opened: the engine and bodies of the service."""

    models: ModelFolder
    engine: WarmEngine
    bodies: Bodies

    @property
    def has_policy(self) -> bool:
        """Whether latents can come from a policy; otherwise they always come from N(0, I)."""
        return "policy.onnx" in self.models.contracts

    def world(
        self,
        agents: int,
        steering: Steering,
        scenes: SceneRegistry | None = None,
        rules: ActingRules | None = None,
    ) -> World:
        """A world for `agents` agents, all stepped at the same moments, in one batch.

        `scenes`: the scenes that its sessions may be in. `rules` act after the model; default: all
        rules. Raises ArtifactError when the start poses are missing or unfit.
        """
        settings = WorldSettings(
            limits=Limits(agents=agents, agents_per_session=agents),
            steering=steering,
            phases=1,
            batch_sizes=ANY_SIZE,
            rules=rules or ActingRules(),
        )
        prepare()
        start_poses = load_start_poses(START_POSES)
        return World(self.engine, self.bodies, start_poses, settings, scenes=scenes)


def open_bundle(models: Path, threads: int, engine: EngineKind = "onnxruntime") -> ModelBundle:
    """Raises ArtifactError when body or models are missing or do not fit together.

    Raises InvalidArgument for an engine that is not installed.
    """
    folder = load_models(models)
    return ModelBundle(folder, open_engine(folder, engine, threads), load_bodies(folder.body))
