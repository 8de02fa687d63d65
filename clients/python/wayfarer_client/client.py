"""The asynchronous client."""

from collections.abc import AsyncGenerator, Callable, Iterable, Mapping, Sequence
from contextlib import aclosing
from types import TracebackType
from typing import Any, Self

from wayfarer_client.admin import Admin
from wayfarer_client.bases import BASES
from wayfarer_client.bone_map import BoneMap
from wayfarer_client.character import Character
from wayfarer_client.connection import Access, Connection, Tls
from wayfarer_client.joints import character_joints
from wayfarer_client.messages import (
    AgentSpec,
    Batch,
    BodyFit,
    Goal,
    MotionFile,
    PoseFormat,
    enum_label,
    vector,
)
from wayfarer_client.scenes import SceneHandle, Scenes
from wayfarer_client.session import Session
from wayfarer_client.v1 import (
    agent_pb2,
    catalog_pb2,
    common_pb2,
    motion_pb2,
    session_pb2,
    snapshot_pb2,
)
from wayfarer_client.wire import GENDERS, BatchReader


class Client:
    """A connection to a server. Use it as `async with`, or call `connect` and `close`."""

    def __init__(
        self,
        address: str = "localhost:50051",
        timeout: float = 10.0,
        *,
        api_key: str = "",
        token: str | Callable[[], str] = "",
        tls: Tls | None = None,
    ) -> None:
        """`timeout`: seconds for connecting and for each call.

        `token` is a JWT, or a function that returns a fresh one and is called for every call.
        Keys and tokens can be read on the way unless `tls` is given.
        """
        self.connection = Connection(address, timeout, Access(api_key, token), tls)
        self.admin = Admin(self.connection)
        self.scenes = Scenes(self.connection)

    @property
    def address(self) -> str:
        """Host and port of the server, as they were given."""
        return self.connection.address

    async def connect(self) -> Self:
        """Waits until the server answers. Raises Unavailable."""
        await self.connection.ready()
        return self

    async def close(self) -> None:
        """Closes the connection. Sessions remain until they are deleted or their lease ends."""
        await self.connection.close()

    async def __aenter__(self) -> Self:
        return await self.connect()

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    # sessions

    async def create_session(
        self,
        basis: str = "gltf",
        *,
        seed: int | None = None,
        lease: float | None = None,
        lock_step: bool = False,
        record: bool = False,
        scene: SceneHandle | str = "",
        avoid: bool = True,
    ) -> Session:
        """Opens a session; basis: gltf, unity, unreal, unreal_mannequin, blender or ros.

        `seed`: agents without a seed draw theirs from it. `lease`: seconds that the session
        outlives its last call and stream. `lock_step`: time passes only in `Session.step`.
        `record`: keep its commands for `Session.export_log`. `scene`: where its agents walk; empty:
        the endless flat floor. `avoid`: agents avoid each other.
        """
        request = session_pb2.CreateSessionRequest(
            basis=enum_label(common_pb2.Basis, basis, "basis"),
            seed=seed,
            lease_s=lease,
            scene=scene if isinstance(scene, str) else scene.scene_id,
            avoid=avoid,
            lock_step=lock_step,
            record=record,
        )
        reply = await self.connection.create(self.connection.sessions.CreateSession, request)
        return self._session(reply.session, owned=True)

    async def session(self, session_id: str) -> Session:
        """Joins an existing session, which is not deleted at the end. Raises NotFound."""
        request = session_pb2.GetSessionRequest(session_id=session_id)
        reply = await self.connection.call(self.connection.sessions.GetSession, request)
        return self._session(reply.session, owned=False)

    async def sessions(self) -> list[Session]:
        """The sessions of this caller, oldest first."""
        request = session_pb2.ListSessionsRequest()
        reply = await self.connection.call(self.connection.sessions.ListSessions, request)
        return [self._session(message, owned=False) for message in reply.sessions]

    async def import_session(self, snapshot: bytes) -> Session:
        """Resumes a session from `Session.export`, on this or another server."""
        request = snapshot_pb2.ImportSessionRequest(snapshot=snapshot)
        reply = await self.connection.call(self.connection.snapshots.ImportSession, request)
        return self._session(reply.session, owned=True)

    def _session(self, message: session_pb2.Session, owned: bool) -> Session:
        if message.HasField("endpoint"):  # one node of several has it
            where = message.endpoint
            self.connection.learn(message.session_id, where.host, where.grpc_port)
        return Session(self.connection, message, owned)

    # clips and replays

    def generate_clip(
        self,
        agent: AgentSpec,
        goals: Iterable[Goal],
        seconds: float,
        *,
        until_arrival: bool = False,
        basis: str = "gltf",
        format: PoseFormat | None = None,
    ) -> AsyncGenerator[Batch]:
        """One agent's walk, as fast as the server can make it. Times count from its start.

        `until_arrival`: end once the last goal is reached and the agent stands. `tracks` joins the
        batches: `tracks([batch async for batch in client.generate_clip(...)])`.
        """
        request = _clip_request(agent, goals, seconds, until_arrival, basis)
        request.format.CopyFrom((format or PoseFormat()).to_wire())
        return self._batches(self.connection.messages(self.connection.motion.GenerateClip, request))

    async def generate_file(
        self,
        agent: AgentSpec,
        goals: Iterable[Goal],
        seconds: float,
        file: MotionFile | None = None,
        *,
        until_arrival: bool = False,
        basis: str = "gltf",
    ) -> bytes:
        """The clip of `generate_clip` as a file's content. None: a GLB with body and motion."""
        request = _clip_request(agent, goals, seconds, until_arrival, basis)
        request.file.CopyFrom((file or MotionFile()).to_wire())
        return await self.connection.file(self.connection.motion.GenerateClip, request)

    def replay(self, log: bytes, *, format: PoseFormat | None = None) -> AsyncGenerator[Batch]:
        """The motion of a session from `Session.export_log`, with its original times."""
        request = snapshot_pb2.ReplayRequest(log=log, format=(format or PoseFormat()).to_wire())
        return self._batches(self.connection.messages(self.connection.snapshots.Replay, request))

    async def _batches(self, messages: AsyncGenerator[Any]) -> AsyncGenerator[Batch]:
        reader = BatchReader()
        async with aclosing(messages):
            async for message in messages:
                if message.HasField("header"):
                    reader.begin(message.header)
                elif message.HasField("batch"):
                    yield reader.batch(message.batch)

    # the catalogue

    async def server_info(self) -> catalog_pb2.GetServerInfoResponse:
        """Version, frame rate, limits, bases."""
        request = catalog_pb2.GetServerInfoRequest()
        return await self.connection.call(self.connection.catalog.GetServerInfo, request)

    async def skeleton(self) -> catalog_pb2.Skeleton:
        """Bones, parents, and names in common engines."""
        return await self.connection.skeleton()

    async def bodies(self) -> list[catalog_pb2.Body]:
        """Bodies that agents can have."""
        request = catalog_pb2.ListBodiesRequest()
        reply = await self.connection.call(self.connection.catalog.ListBodies, request)
        return list(reply.bodies)

    async def fit_body(
        self,
        character: Character | BoneMap | Mapping[str, Sequence[float]],
        *,
        floor: float | None = None,
        gender: str = "",
        basis: str = "gltf",
    ) -> BodyFit:
        """The body whose bones are as long as a character's: `fit.spec()` makes such an agent.

        `character`: its file, the map of its bones, or its joints' places by bone; hips, knees and
        ankles are needed. `floor`: height under its soles, which a map knows if the character
        stands on the ground. `gender`: that of the body; empty: the one that fits better. Raises
        InvalidArgument.
        """
        if isinstance(character, Character | BoneMap):
            bones = character if isinstance(character, BoneMap) else character.bones
            soles = None if isinstance(character, BoneMap) else character.soles
            places, ground = character_joints(bones, BASES[basis], soles.floor if soles else None)
            floor = ground if floor is None else floor
            joints = {bone: place.tolist() for bone, place in places.items()}
        else:
            joints = dict(character)
        request = catalog_pb2.FitBodyRequest(
            joints=(
                catalog_pb2.CharacterJoint(bone=bone, position=vector(place))
                for bone, place in joints.items()
            ),
            floor=floor,
            gender=enum_label(agent_pb2.Gender, gender, "gender") if gender else None,
            basis=enum_label(common_pb2.Basis, basis, "basis"),
        )
        reply = await self.connection.call(self.connection.catalog.FitBody, request)
        return BodyFit(
            body=reply.body,
            gender=GENDERS.get(reply.gender, ""),
            betas=tuple(reply.betas),
            scale=reply.scale,
            errors_cm={length.name: length.error_cm for length in reply.lengths},
        )

    async def models(self) -> list[catalog_pb2.Model]:
        """Motion models that are loaded."""
        request = catalog_pb2.ListModelsRequest()
        reply = await self.connection.call(self.connection.catalog.ListModels, request)
        return list(reply.models)


def _clip_request(
    agent: AgentSpec, goals: Iterable[Goal], seconds: float, until_arrival: bool, basis: str
) -> motion_pb2.GenerateClipRequest:
    return motion_pb2.GenerateClipRequest(
        agent=agent.to_wire(),
        goals=[goal.message for goal in goals],
        seconds=seconds,
        until_arrival=until_arrival,
        basis=enum_label(common_pb2.Basis, basis, "basis"),
    )
