"""Client of Wayfarer, a motion-generation service: goals in, poses out as numpy arrays.

`Client` is asynchronous, `SyncClient` is the same for programs without an event loop.
"""

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
    WayfarerError,
)
from wayfarer_client.jitter import JitterBuffer, Pose
from wayfarer_client.messages import (
    Agent,
    AgentSpec,
    Batch,
    Event,
    Flag,
    Frames,
    Goal,
    Phenotype,
    PoseFormat,
    StreamInfo,
)
from wayfarer_client.session import Session
from wayfarer_client.stream import MotionStream
from wayfarer_client.sync import SyncClient, SyncSession
from wayfarer_client.tracks import Track, tracks

__all__ = [
    "Aborted",
    "Agent",
    "AgentSpec",
    "AlreadyExists",
    "Batch",
    "Client",
    "Control",
    "Event",
    "FailedPrecondition",
    "Flag",
    "Frames",
    "Goal",
    "InternalError",
    "InvalidArgument",
    "JitterBuffer",
    "Misdirected",
    "MotionStream",
    "NotFound",
    "PermissionDenied",
    "Phenotype",
    "Pose",
    "PoseFormat",
    "ResourceExhausted",
    "Session",
    "StreamInfo",
    "SyncClient",
    "SyncSession",
    "Tls",
    "Track",
    "Unauthenticated",
    "Unavailable",
    "WayfarerError",
    "tracks",
]
