"""What the server has and allows, its health, and its models."""

from pydantic import ConfigDict, Field

from wayfarer.limits import Limits
from wayfarer.transport.schema.agents import Gender
from wayfarer.transport.schema.base import BasisInfo, Bool, Message


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
