"""Client of Wayfarer, a motion-generation service: goals in, poses out as numpy arrays.

`Client` is asynchronous, `SyncClient` is the same for programs without an event loop.
"""

from wayfarer_client.client import Client, Session
from wayfarer_client.errors import (
    AlreadyExists,
    FailedPrecondition,
    InternalError,
    InvalidArgument,
    NotFound,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
)
from wayfarer_client.jitter import JitterBuffer, Pose
from wayfarer_client.messages import Agent, AgentSpec, Batch, Flag, Frames, Goal, Phenotype
from wayfarer_client.sync import SyncClient, SyncSession

__all__ = [
    "Agent",
    "AgentSpec",
    "AlreadyExists",
    "Batch",
    "Client",
    "FailedPrecondition",
    "Flag",
    "Frames",
    "Goal",
    "InternalError",
    "InvalidArgument",
    "JitterBuffer",
    "NotFound",
    "Phenotype",
    "Pose",
    "ResourceExhausted",
    "Session",
    "SyncClient",
    "SyncSession",
    "Unavailable",
    "WayfarerError",
]
