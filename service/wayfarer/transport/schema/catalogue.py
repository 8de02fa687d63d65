"""What the server has and allows, its health, and its models."""

from pydantic import ConfigDict, Field

from wayfarer.body.skeleton import joint_names
from wayfarer.limits import Limits
from wayfarer.spec import POSED_JOINTS
from wayfarer.transport.basis import Basis
from wayfarer.transport.schema.agents import Gender
from wayfarer.transport.schema.base import (
    BasisInfo,
    Bool,
    Length,
    Many,
    Message,
    Vector3,
)


class Bone(Message):
    """One bone, with its name in common engines; empty where an engine has no such bone."""

    name: str
    parent: int = Field(description="index of the parent in `bones`; -1 for the root")
    mixamo: str = ""
    unity: str = ""
    vrm: str = ""
    ue: str = ""


class Skeleton(Message):
    """The bones of an agent; parents come before children."""

    bones: tuple[Bone, ...]
    posed_bones: int = Field(description="the model moves the first bones, this many")


class Body(Message):
    """A body that agents can have."""

    name: str
    gender: Gender
    betas: int
    vertices: int
    faces: int
    min_height_m: float
    max_height_m: float
    glb_path: str


class Bodies(Message):
    """The bodies that agents can have."""

    bodies: tuple[Body, ...]


class CharacterJoint(Message):
    """A joint of a character at rest."""

    bone: str = Field(
        max_length=64,
        description="canonical name of its bone",
        json_schema_extra={"enum": list(joint_names()[:POSED_JOINTS])},
    )
    position: Vector3


class CharacterJoints(Message):
    """Asks for a body with the proportions of a character."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "joints": [
                        {"bone": f"{side}_{bone}", "position": {"x": x, "y": y, "z": 0}}
                        for side, x in (("left", 0.1), ("right", -0.1))
                        for bone, y in (("hip", 0.95), ("knee", 0.52), ("ankle", 0.09))
                    ],
                    "floor": 0,
                }
            ]
        }
    )

    joints: Many[CharacterJoint] = Field(
        min_length=6,
        max_length=POSED_JOINTS,
        description="in any pose, each once; hips, knees and ankles are needed",
    )
    floor: Length | None = Field(
        default=None,
        description="height of the floor under its soles along the basis's up axis; "
        "absent: the height of its ankles is left out",
    )
    gender: Gender | None = Field(
        default=None, description="of the body; absent: the one that fits better"
    )
    basis: Basis = Field(default=Basis.GLTF, description="basis of the places")


class FittedLength(Message):
    """A length of a character, and of the body found for it."""

    name: str = Field(
        description="thigh, shin, foot, upper_arm, forearm (means of both sides); hips, shoulders "
        "(from left to right), torso (between the middles of these); ankle_height"
    )
    character_m: float
    body_m: float = Field(description="of the body × scale")
    error_cm: float = Field(description="above 0 where the body is longer")


class FittedBody(Message):
    """A body with the proportions of a character."""

    body: str
    gender: Gender = Field(description="for AgentSpec.gender")
    betas: tuple[float, ...] = Field(description="for AgentSpec.betas")
    scale: float = Field(
        description="size of the character by that of the body: 1 where a person can have such legs"
    )
    lengths: tuple[FittedLength, ...]


class Model(Message):
    """A loaded motion model."""

    name: str
    genders: tuple[Gender, ...]
    seed_frames: int
    primitive_frames: int
    sha256: tuple[str, ...] = Field(description="SHA-256 of each graph, in the order of `genders`")
    in_use: bool = Field(description="this model moves new agents")


class Models(Message):
    """The loaded motion models."""

    models: tuple[Model, ...]


class NewModel(Message):
    """A model to load."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "gamma-anny52"}]})

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$",
        description="a shipped model, or a folder inside the server's models folder",
    )


class ModelUse(Message):
    """How to use a loaded model."""

    move_agents: Bool = Field(default=False, description="move the present agents too")


class ModelUsed(Message):
    """The model is in use."""

    moved: int = Field(description="number of agents that change their model")


class ServerInfo(Message):
    """A description of the server."""

    version: str
    fps: int
    frames_per_chunk: int
    limits: Limits
    bases: tuple[BasisInfo, ...]


class Health(Message):
    """The answer to a probe."""

    status: str
