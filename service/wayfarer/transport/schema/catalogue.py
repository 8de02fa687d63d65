"""What the server has and allows, its health, and its models."""

from pydantic import ConfigDict, Field

from wayfarer.body.skeleton import joint_names
from wayfarer.spec import POSED_JOINTS
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.schema.agents import Gender
from wayfarer.transport.schema.base import (
    Length,
    Many,
    Message,
    Vector3,
)


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


class NewModel(Message):
    """A model to load."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "gamma-anny52"}]})

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$",
        description="a shipped model, or a folder inside the server's models folder",
    )


class Health(Message):
    """The answer to a probe."""

    status: str
