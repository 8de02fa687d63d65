"""Scenes, their obstacles, ways through them, and the people who live there."""

import asyncio
import contextlib
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import asdict
from hashlib import sha256
from typing import Final

import structlog

from wayfarer.errors import (
    FailedPrecondition,
    InvalidArgument,
    Misdirected,
    NotFound,
    Unavailable,
)
from wayfarer.ids import request_group
from wayfarer.ids import scene_id as new_scene_id
from wayfarer.navigation.examples import EXAMPLES
from wayfarer.navigation.scene import Scene
from wayfarer.navigation.scene_spec import MeshFile, SceneSpec
from wayfarer.transport import schema
from wayfarer.transport.conversion import convert, scene_convert
from wayfarer.transport.conversion.units import place
from wayfarer.transport.edge.caller import current_caller
from wayfarer.transport.gateway.context import GatewayContext, implements
from wayfarer.transport.gateway.idempotency import finish
from wayfarer.transport.gateway.leases import attributes
from wayfarer.transport.gateway.scene_access import SCENE_LEASE_S
from wayfarer.transport.gateway.session_registry import OpenSession
from wayfarer.transport.gateway.uploads import Uploads
from wayfarer.world.scenes.messages import Crowd, CrowdState, SceneSource
from wayfarer.world.scenes.outlines import outlines
from wayfarer.world.scenes.scene_registry import SceneRegistry

log = structlog.get_logger(__name__)

DATA: Final = "data"
"""The field that holds a mesh, in errors."""

NewScene = schema.NewScene | schema.NewExampleScene


class SceneApi:
    """SceneService."""

    def __init__(self, context: GatewayContext) -> None:
        self._context = context
        self._runtime = context.service.scenes
        self._uploads = Uploads(context.limits.mesh_bytes)

    @implements("CreateScene")
    async def create(self, request: schema.NewScene) -> schema.Scene:
        """Makes a scene. Raises InvalidArgument, Aborted, ResourceExhausted, Unavailable."""
        self._context.require_ready()

        async def make(digest: str) -> schema.Scene:
            with scene_convert.fields_named(request.solids):
                return await self._create(
                    request, request.name, lambda: scene_convert.scene_spec(request), digest
                )

        return await self._context.replies.once(request.request_id, ("CreateScene", request), make)

    @implements("CreateMeshScene")
    async def create_from_mesh(
        self, request: schema.MeshScene, pieces: AsyncIterator[bytes]
    ) -> schema.Scene:
        """Makes a scene from a file that comes in pieces. Raises as `create`."""
        self._context.require_ready()
        scene = request.scene
        async with self._uploads.received(pieces, DATA) as data:
            # so that the same id with a different file is a different request
            digest = await asyncio.to_thread(lambda: sha256(data).hexdigest())

            def mesh() -> MeshFile:
                return scene_convert.mesh_file(request.mesh, scene.basis, data)

            async def make(known_as: str) -> schema.Scene:
                with scene_convert.fields_named(scene.solids):
                    return await self._create(
                        scene, scene.name, lambda: scene_convert.scene_spec(scene, mesh()), known_as
                    )

            where = f"CreateMeshScene {digest}"
            return await self._context.replies.once(scene.request_id, (where, request), make)

    @implements("ListExampleScenes")
    def examples(self) -> schema.ExampleScenes:
        """The scenes that come with the server."""
        return schema.ExampleScenes(
            examples=tuple(
                schema.ExampleScene(name=name, summary=(make.__doc__ or "").strip())
                for name, make in EXAMPLES.items()
            )
        )

    @implements("CreateExampleScene")
    async def create_example(self, name: str, request: schema.NewExampleScene) -> schema.Scene:
        """Makes an example scene. Raises NotFound, and as `create`."""
        self._context.require_ready()
        if name not in EXAMPLES:
            known, short = ", ".join(EXAMPLES), name[: schema.ID_LENGTH]
            raise NotFound(f"there is no example {short!r}; there are {known}", "example", short)
        return await self._context.replies.once(
            request.request_id,
            (f"CreateExampleScene {name}", request),
            lambda digest: self._create(request, name, EXAMPLES[name], digest),
        )

    async def _create(
        self, request: NewScene, name: str, spec: Callable[[], SceneSpec], digest: str
    ) -> schema.Scene:
        scene_id = ""
        if digest:
            group = request_group(current_caller().name, request.request_id)
            scene_id = new_scene_id(group, digest)
            if scene_id in self._context.scenes.ids():  # made before, and the reply is lost
                return await self.get(scene_id)
            self._context.locator.require_own(scene_id)
        kept = attributes(request, SCENE_LEASE_S, self._context.limits)
        with self._context.scenes.room(current_caller()):
            source = SceneSource(await asyncio.to_thread(spec), name, kept)
            with convert.in_basis(request.basis.axes):
                info = await self._runtime.create(source, scene_id)
            made = self._context.scenes.open(info).describe(info)
        await self._context.locator.claimed(made.scene_id)
        return made

    @implements("GetScene")
    async def get(self, scene_id: str) -> schema.Scene:
        """Describes a scene. Raises NotFound."""
        scene = self._context.scenes.scene(scene_id)
        return scene.describe(self._runtime.registry.entry(scene_id).info())

    @implements("ListScenes")
    async def list_own(self) -> schema.Scenes:
        """The caller's scenes, oldest first; an admin sees all. Renews no lease."""
        infos = {one.scene_id: one for one in self._runtime.registry.infos()}
        owned = self._context.scenes.owned(current_caller())
        return schema.Scenes(
            scenes=tuple(s.describe(infos[s.scene_id]) for s in owned if s.scene_id in infos)
        )

    @implements("DeleteScene")
    async def delete(self, scene_id: str) -> None:
        """Removes a scene. Raises NotFound, FailedPrecondition."""
        scene = self._context.scenes.scene(scene_id)
        await self._runtime.change(SceneRegistry.delete, scene_id)
        self._context.scenes.close(scene.scene_id, scene)
        await self._context.locator.copied(scene_id)

    @implements("PutObstacle")
    async def put_obstacle(
        self, scene_id: str, name: str, request: schema.Obstacle
    ) -> schema.SceneVersion:
        """Adds an obstacle or moves an existing one.

        Raises NotFound, InvalidArgument, ResourceExhausted, FailedPrecondition.
        """
        scene = self._context.scenes.scene(scene_id)
        with scene_convert.fields_named(obstacle=request), convert.in_basis(scene.axes):
            made = scene_convert.obstacle(request, scene.axes)
            info = await self._runtime.change(SceneRegistry.put, scene_id, name, made)
        await self._context.locator.copied(scene_id)
        return scene_convert.scene_version(info)

    @implements("RemoveObstacle")
    async def remove_obstacle(self, scene_id: str, name: str) -> schema.SceneVersion:
        """Removes an obstacle. Raises NotFound."""
        self._context.scenes.scene(scene_id)
        info = await self._runtime.change(SceneRegistry.remove, scene_id, name)
        await self._context.locator.copied(scene_id)
        return scene_convert.scene_version(info)

    @implements("QueryPath")
    async def query_path(self, scene_id: str, request: schema.PathQuery) -> schema.ScenePath:
        """The way that an agent would take. Raises NotFound, InvalidArgument, Unreachable."""
        scene = self._context.scenes.scene(scene_id)
        start, goal = (place(p, scene.axes) for p in (request.start, request.goal))
        with scene_convert.fields_named(), convert.in_basis(scene.axes):
            way = await self._runtime.look(Scene.path, scene_id, start, goal)
        return scene_convert.scene_path(way, scene.axes)

    @implements("GetSceneOutlines")
    async def outlines(self, scene_id: str) -> schema.SceneOutlines:
        """Outlines for drawing it. Raises NotFound."""
        scene = self._context.scenes.scene(scene_id)
        found = await self._runtime.look(outlines, scene_id)
        return await asyncio.to_thread(scene_convert.outlines, found, scene.axes)

    @implements("GetScenePicture")
    async def picture(self, scene_id: str) -> bytes:
        """A picture from above, PNG. Raises NotFound."""
        # the image library is loaded with the first picture
        from wayfarer.navigation.picture import top_view

        self._context.scenes.scene(scene_id)
        return await self._runtime.look(top_view, scene_id)

    @implements("PopulateSession")
    async def populate(self, session_id: str, request: schema.Crowd) -> schema.CrowdCame:
        """Makes people come and go. Raises NotFound, FailedPrecondition, InvalidArgument; and
        ResourceExhausted beyond the caller's quota.
        """
        self._context.require_ready()
        session = self._context.sessions.session(session_id)
        if not session.scene:
            raise FailedPrecondition(
                "the session is in no scene; name one when you create it, as `scene`"
            )
        most = self._context.limits.agents_per_session
        if request.count > most:
            raise InvalidArgument(f"is {request.count}; allowed: {most}", "count")
        crowd = scene_convert.crowd(request, session.basis, secrets.randbits(32))
        # runs to its end even if the caller disconnects, since the crowd counts towards the quota
        state = await finish(self._populate(session, crowd))
        return schema.CrowdCame(**asdict(state))

    async def _populate(self, session: OpenSession, crowd: Crowd) -> CrowdState:
        more = max(crowd.count - session.crowd, 0)
        with self._context.sessions.agent_room(current_caller(), more):
            try:
                with convert.in_basis(session.basis.axes):
                    state = await self._runtime.populate(session.session_id, crowd)
            except Unavailable:  # it may be moving
                session.crowd = max(session.crowd, crowd.count)
                raise
            session.crowd = state.came + state.waiting  # another call may have replaced it
        await self._context.locator.copied(session.session_id)
        return state

    async def take_over(self) -> None:
        """Enters the scenes that the runtime has kept over a restart."""
        for info in self._runtime.registry.infos():
            try:
                self._context.scenes.open(info)
            except InvalidArgument as error:
                log.error("scene not taken over", scene_id=info.scene_id, reason=str(error))
                with contextlib.suppress(FailedPrecondition):
                    await self._runtime.change(SceneRegistry.delete, info.scene_id)

    async def end_expired(self) -> None:
        """Removes the scenes whose lease has expired and that no session uses.

        Scenes that cannot be removed now are tried again at the next call.
        """
        for scene in self._context.scenes.expired():
            try:
                await self._runtime.change(SceneRegistry.delete, scene.scene_id)
            except FailedPrecondition:  # sessions use it
                self._context.scenes.renew(scene)
                continue
            except Unavailable:
                continue
            except (NotFound, Misdirected):  # its client, or a move, was quicker
                pass
            log.info("lease ended", scene_id=scene.scene_id, lease_s=scene.lease_s)
            self._context.scenes.close(scene.scene_id, scene)
