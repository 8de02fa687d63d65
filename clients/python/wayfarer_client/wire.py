"""Protobuf → the values of messages.py."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final

import numpy as np

from wayfarer_client.errors import WayfarerError
from wayfarer_client.messages import Agent, Batch, Event, Flag, Frames, Goal, Place, StreamInfo
from wayfarer_client.poses import Layout, layouts_of
from wayfarer_client.v1 import agent_pb2, common_pb2, motion_pb2


def _words(enum: Any) -> Mapping[int, str]:
    """{1: "walking" …} of an enum; readers give "" for unknown numbers."""
    prefix = enum.keys()[0].removesuffix("UNSPECIFIED")
    return {number: name.removeprefix(prefix).lower() for name, number in enum.items() if number}


STATES: Final = _words(agent_pb2.AgentState)
GENDERS: Final = _words(agent_pb2.Gender)
EVENTS: Final = _words(motion_pb2.EventKind)
ENCODINGS: Final = _words(motion_pb2.PoseEncoding)
COLUMNS: Final = (
    *("aliases", "seqs", "first_frames", "scheduled_at_us", "goal_revisions", "states"),
    *("flags", "waypoints", "candidates"),
)
"""Columns of MotionChunks with a number for each chunk."""


class BatchReader:
    """Turns the messages of one stream into batches, and keeps the agents introduced."""

    def __init__(self, layout: Layout | None = None) -> None:
        self.info: StreamInfo | None = None
        self.agents: dict[int, Agent] = {}  # by alias
        self._layouts: list[Layout] = [layout] if layout else []
        self._resumed_at: float | None = None

    def begin(self, header: motion_pb2.StreamHeader, sent_at: float = 0.0) -> StreamInfo:
        """Reads the header. Raises WayfarerError when the poses cannot be read."""
        if self.info is not None:
            self._resumed_at = sent_at
        bones, self._layouts = layouts_of(header)
        self.info = info_from_wire(header, bones)
        if not self.info.resumed:
            self.agents.clear()
        return self.info

    def batch(self, message: motion_pb2.MotionBatch, sent_at: float = 0.0) -> Batch:
        """Reads a batch."""
        added = tuple(agent_from_wire(agent) for agent in message.added)
        fresh = tuple(agent for agent in added if agent.alias not in self.agents)
        self.agents.update((agent.alias, agent) for agent in added)
        frames = tuple(self._frames(message.chunks, message.tier))
        return Batch(
            sent_at,
            frames,
            fresh,
            self._gone(message.removed),
            hidden=self._gone(message.hidden),
            tier=message.tier,
            resume_token=message.resume_token,
            resumed_at=self._resumed_at,
        )

    def event(self, message: motion_pb2.Event) -> Event:
        """Reads an event."""
        return Event(
            kind=EVENTS.get(message.kind, ""),
            at=message.at_us / 1e6,
            agent=self.agents.get(message.alias) if message.agent_id else None,
            goal_revision=message.goal_revision,
            waypoint=message.waypoint,
            detail=message.detail,
        )

    def _gone(self, aliases: Iterable[int]) -> tuple[Agent, ...]:
        gone = [self.agents.pop(alias, None) for alias in aliases]
        return tuple(agent for agent in gone if agent is not None)

    def _frames(self, chunks: motion_pb2.MotionChunks, tier: int) -> Iterator[Frames]:
        """Chunks of the known agents. Raises WayfarerError when the columns do not fit."""
        if not chunks.aliases:
            return
        assert self._layouts, "the server sent a batch before its header"
        if tier >= len(self._layouts):
            raise WayfarerError(f"the header tells of {len(self._layouts)} tiers, not of {tier}")
        layout = self._layouts[tier]
        count = len(chunks.aliases)
        poses = layout.unpack(chunks.poses)
        contacts = np.frombuffer(chunks.contacts, np.uint8)
        frames, rest = divmod(len(contacts), count)
        columns = [getattr(chunks, name) for name in COLUMNS]
        if rest or len(poses.translation) != len(contacts) or {*map(len, columns)} != {count}:
            raise WayfarerError(f"the columns of a batch of {count} chunks are not of one length")
        touching = (contacts[:, None] & np.array([1, 2])).astype(bool)
        since = np.arange(frames) / layout.fps
        for row, (alias, seq, first, at, revision, state, flags, waypoint, candidates) in enumerate(
            zip(*columns, strict=True)
        ):
            if alias not in self.agents:
                continue
            own = slice(row * frames, (row + 1) * frames)
            yield Frames(
                agent=self.agents[alias],
                seq=seq,
                first_frame=first,
                goal_revision=revision,
                state=STATES.get(state, ""),
                flags=Flag(flags),
                times=at / 1e6 + since,
                translation=poses.translation[own],
                rotations=poses.rotations[own],
                contacts=touching[own],
                waypoint=waypoint,
                candidates=candidates,
            )


def info_from_wire(header: motion_pb2.StreamHeader, bones: Iterable[int]) -> StreamInfo:
    """From protobuf."""
    names = [bone.name for bone in header.skeleton.bones]
    return StreamInfo(
        server_version=header.server_version,
        session_id=header.session_id,
        encoding=ENCODINGS[header.pose_encoding],
        fps=header.sent_fps or header.fps,
        bones=tuple(names[bone] for bone in bones),
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
        goal=Goal.from_wire(goal) if message.HasField("goal") else None,
        goal_revision=message.goal_revision,
        created_at=message.created_at_us / 1e6,
        rest_offsets=np.array(message.rest_offsets, np.float32).reshape(-1, 3),
        waypoint=message.waypoint,
        waypoints=message.waypoints,
        foot_lock=message.foot_lock,
        model=message.model,
        outfit=message.outfit,
    )


def _place(message: common_pb2.Vector3) -> Place:
    return message.x, message.y, message.z
