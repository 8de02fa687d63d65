"""Replies of a stand-in server: streams, control, sessions."""

import grpc

from tests.clients.fake_server import Refusal
from tests.golden import messages
from wayfarer_client.v1 import agent_pb2, control_pb2, motion_pb2, session_pb2

GONE = Refusal(grpc.StatusCode.UNAVAILABLE, "the server is shutting down")
HEADER = motion_pb2.StreamMotionResponse(
    header=motion_pb2.StreamHeader(
        server_version="1",
        session_id="s",
        fps=40,
        sent_fps=40,
        pose_encoding=motion_pb2.POSE_ENCODING_F32_LE,
        bones=[0, 1],
        skeleton=messages.header().skeleton,
    )
)


HEARTBEAT = motion_pb2.StreamMotionResponse(heartbeat=motion_pb2.Heartbeat())


def resumed() -> motion_pb2.StreamMotionResponse:
    """The header of a stream that continues."""
    header = motion_pb2.StreamMotionResponse()
    header.CopyFrom(HEADER)
    header.header.resumed = True
    return header


def batch(token: str, seq: int = 0, added: bool = True, flags: int = 0):
    agent = agent_pb2.Agent(agent_id="a-1", alias=1, name="Ada", gender=1, state=1)
    chunks = motion_pb2.MotionChunks(
        aliases=[1],
        seqs=[seq],
        first_frames=[8 * seq],
        scheduled_at_us=[200_000 * seq],
        goal_revisions=[0],
        states=[0],
        flags=[flags],
        poses=messages.float_poses(8),
        contacts=bytes(8),
        waypoints=[0],
        candidates=[0],
    )
    return motion_pb2.StreamMotionResponse(
        sent_at_us=5,
        batch=motion_pb2.MotionBatch(
            added=[agent] if added else [], chunks=chunks, resume_token=token
        ),
    )


def event(kind: int, **fields: object):
    return motion_pb2.StreamMotionResponse(event=motion_pb2.Event(kind=kind, **fields))


def new_session(request):
    session = session_pb2.Session(session_id="s", lease_s=request.lease_s or 60, seed=request.seed)
    return session_pb2.CreateSessionResponse(session=session)


def replied(**fields: object):
    def reply(request: control_pb2.ControlRequest) -> control_pb2.ControlResponse:
        return control_pb2.ControlResponse(
            reply=control_pb2.CommandReply(command_id=request.command_id, **fields)
        )

    return reply


def moved(message: motion_pb2.StreamMotionResponse) -> control_pb2.ControlResponse:
    return control_pb2.ControlResponse(motion=message)
