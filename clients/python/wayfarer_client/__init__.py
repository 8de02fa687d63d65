"""Client of Wayfarer, a motion-generation service: goals in, poses out as numpy arrays.

`Client` is asynchronous, `SyncClient` is the same for programs without an event loop.
"""

from wayfarer_client.bases import BASES, Basis
from wayfarer_client.behaviours import (
    Behaviour,
    Follow,
    KeepAway,
    Part,
    Patrol,
    Queue,
    Routine,
    Stand,
    Visit,
    Wander,
)
from wayfarer_client.bone_map import BoneMap, map_bones
from wayfarer_client.character import Character
from wayfarer_client.client import Client
from wayfarer_client.connection import Tls
from wayfarer_client.control import Control
from wayfarer_client.errors import (
    Aborted,
    AlreadyExists,
    FailedPrecondition,
    InternalError,
    InvalidArgument,
    Misdirected,
    NotFound,
    PermissionDenied,
    ResourceExhausted,
    Unauthenticated,
    Unavailable,
    Unreachable,
    WayfarerError,
)
from wayfarer_client.jitter import JitterBuffer, Pose
from wayfarer_client.joints import character_joints
from wayfarer_client.messages import (
    Agent,
    AgentSpec,
    Batch,
    BodyFit,
    CrowdCame,
    Event,
    Flag,
    Frames,
    Goal,
    Interest,
    MotionFile,
    Phenotype,
    PoseFormat,
    Ring,
    StreamInfo,
    Viewpoint,
)
from wayfarer_client.playout import PlayoutClock, PoseTrack
from wayfarer_client.retarget import CharacterPose, Retarget
from wayfarer_client.rig import Node, Rig
from wayfarer_client.root import SmoothRoot
from wayfarer_client.scenes import Scene, Scenes, Way
from wayfarer_client.session import Session
from wayfarer_client.shapes import (
    Box,
    Cylinder,
    Floor,
    Obstacle,
    Prism,
    Ramp,
    Solid,
    Walkable,
)
from wayfarer_client.stream import MotionStream
from wayfarer_client.sync import SyncClient, SyncScene, SyncScenes, SyncSession
from wayfarer_client.tracks import Track, tracks

__all__ = [
    "BASES",
    "Aborted",
    "Agent",
    "AgentSpec",
    "AlreadyExists",
    "Basis",
    "Batch",
    "Behaviour",
    "BodyFit",
    "BoneMap",
    "Box",
    "Character",
    "CharacterPose",
    "Client",
    "Control",
    "CrowdCame",
    "Cylinder",
    "Event",
    "FailedPrecondition",
    "Flag",
    "Floor",
    "Follow",
    "Frames",
    "Goal",
    "Interest",
    "InternalError",
    "InvalidArgument",
    "JitterBuffer",
    "KeepAway",
    "Misdirected",
    "MotionFile",
    "MotionStream",
    "Node",
    "NotFound",
    "Obstacle",
    "Part",
    "Patrol",
    "PermissionDenied",
    "Phenotype",
    "PlayoutClock",
    "Pose",
    "PoseFormat",
    "PoseTrack",
    "Prism",
    "Queue",
    "Ramp",
    "ResourceExhausted",
    "Retarget",
    "Rig",
    "Ring",
    "Routine",
    "Scene",
    "Scenes",
    "Session",
    "SmoothRoot",
    "Solid",
    "Stand",
    "StreamInfo",
    "SyncClient",
    "SyncScene",
    "SyncScenes",
    "SyncSession",
    "Tls",
    "Track",
    "Unauthenticated",
    "Unavailable",
    "Unreachable",
    "Viewpoint",
    "Visit",
    "Walkable",
    "Wander",
    "Way",
    "WayfarerError",
    "character_joints",
    "map_bones",
    "tracks",
]
