"""Protobuf → the values of messages.py."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from wayfarer_client.messages import Agent, Batch, Event, Flag, Frames, Goal, Place, StreamInfo
from wayfarer_client.poses import PoseLayout
from wayfarer_client.v1 import agent_pb2, common_pb2, goal_pb2, motion_pb2


def _words(enum: Any) -> Mapping[int, str]:
    """{1: "walking" …} of an enum; what it does not know is "" to a reader of `get`."""
    prefix = enum.keys()[0].removesuffix("UNSPECIFIED")
    return {number: name.removeprefix(prefix).lower() for name, number in enum.items() if number}


STATES: Final = _words(agent_pb2.AgentState)
GENDERS: Final = _words(agent_pb2.Gender)
EVENTS: Final = _words(motion_pb2.EventKind)
ENCODINGS: Final = _words(motion_pb2.PoseEncoding)


class BatchReader:
    """Turns the messages of one stream into batches; knows the agents it has introduced."""

    def __init__(self, layout: PoseLayout | None = None) -> None:
        self.info: StreamInfo | None = None
        self.agents: dict[int, Agent] = {}  # by alias
        self._layout = layout

    def begin(self, header: motion_pb2.StreamHeader) -> StreamInfo:
        """Read the header. Raises WayfarerError when the poses cannot be read."""
        self._layout = PoseLayout(header)
        self.info = info_from_wire(header, self._layout)
        if not self.info.resumed:
            self.agents.clear()
        return self.info

    def batch(self, message: motion_pb2.MotionBatch, sent_at: float = 0.0) -> Batch:
        """Read a batch."""
        added = tuple(agent_from_wire(agent) for agent in message.added)
        fresh = tuple(agent for agent in added if agent.alias not in self.agents)
        self.agents.update((agent.alias, agent) for agent in added)
        frames = tuple(
            self._frames(chunk) for chunk in message.chunks if chunk.alias in self.agents
        )
        gone = [self.agents.pop(alias, None) for alias in message.removed]
        removed = tuple(agent for agent in gone if agent is not None)
        return Batch(sent_at, frames, fresh, removed, resume_token=message.resume_token)

    def event(self, message: motion_pb2.Event) -> Event:
        """Read an event."""
        return Event(
            kind=EVENTS.get(message.kind, ""),
            at=message.at_us / 1e6,
            agent=self.agents.get(message.alias) if message.agent_id else None,
            goal_revision=message.goal_revision,
            waypoint=message.waypoint,
            detail=message.detail,
        )

    def _frames(self, chunk: motion_pb2.MotionChunk) -> Frames:
        assert self._layout is not None, "the server sent a batch before its header"
        poses = self._layout.unpack(chunk.poses)
        contacts = np.frombuffer(chunk.contacts, np.uint8)
        return Frames(
            agent=self.agents[chunk.alias],
            seq=chunk.seq,
            first_frame=chunk.first_frame,
            goal_revision=chunk.goal_revision,
            state=STATES.get(chunk.state, ""),
            flags=Flag(chunk.flags),
            times=chunk.scheduled_at_us / 1e6 + np.arange(len(contacts)) / self._layout.fps,
            translation=poses.translation,
            rotations=poses.rotations,
            contacts=(contacts[:, None] & np.array([1, 2])).astype(bool),
            waypoint=chunk.waypoint,
            candidates=chunk.candidates,
        )


def info_from_wire(header: motion_pb2.StreamHeader, layout: PoseLayout) -> StreamInfo:
    """From protobuf."""
    names = [bone.name for bone in header.skeleton.bones]
    return StreamInfo(
        server_version=header.server_version,
        session_id=header.session_id,
        encoding=ENCODINGS[header.pose_encoding],
        fps=layout.fps,
        bones=tuple(names[bone] for bone in layout.bones),
        resume_s=header.resume_s,
        resumed=header.resumed,
    )


def agent_from_wire(message: agent_pb2.Agent) -> Agent:
    """From protobuf."""
    goal = message.goal
    return Agent(
        agent_id=message.agent_id,
        alias=message.alias,
        session_id=message.session_id,
        name=message.name,
        body=message.body,
        gender=GENDERS.get(message.gender, ""),
        betas=tuple(message.betas),
        seed=message.seed,
        state=STATES.get(message.state, ""),
        position=_place(message.position),
        heading=message.heading,
        goal=_goal(goal) if message.HasField("goal") else None,
        goal_revision=message.goal_revision,
        created_at=message.created_at_us / 1e6,
        rest_offsets=np.array(message.rest_offsets, np.float32).reshape(-1, 3),
        waypoint=message.waypoint,
        waypoints=message.waypoints,
        foot_lock=message.foot_lock,
        model=message.model,
    )


def _goal(message: goal_pb2.Goal) -> Goal:
    return Goal(
        position=_place(message.position),
        radius=message.radius,
        speed=message.speed,
        heading=message.heading if message.HasField("heading") else None,
        stop=message.stop if message.HasField("stop") else True,
        strafe=message.strafe,
        dwell=message.dwell,
    )


def _place(message: common_pb2.Vector3) -> Place:
    return message.x, message.y, message.z
