"""`/mmcp/capabilities` and `/mmcp/generate`, by the protocol's own SDK (the extra `mmcp`).

A request's words (prompts.py) or its root path become goals. The person that walks has the
proportions of the client's skeleton, and the motion is retargeted to that skeleton.
"""

import asyncio
import math
from typing import Any, Final

import numpy as np
from fastapi import FastAPI
from motionmcp import Backbone, GenerateRequest, ModelSpec, MotionResult
from motionmcp.backbone import Limits as ProtocolLimits
from motionmcp.errors import ProtocolError
from motionmcp.schemas import RootPathConstraint
from motionmcp.server import build_app
from starlette.routing import Route

from wayfarer.clips.clip import Clip
from wayfarer.clips.edit import resampled
from wayfarer.errors import (
    InvalidArgument,
    PermissionDenied,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
)
from wayfarer.spec import FPS
from wayfarer.transport import schema
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.mmcp import skeletons
from wayfarer.transport.mmcp.prompts import SPEEDS, Clause, orders

MODEL: Final = "wayfarer"
SAMPLES: Final = 4
DURATION_S: Final = 30.0
SLOWEST, FASTEST = 0.2, 4.0
CODES: Final = {
    PermissionDenied: "forbidden",
    ResourceExhausted: "resource_exhausted",
    Unavailable: "model_unavailable",
    InvalidArgument: "invalid_request",
}


def mmcp_app(gateway: Gateway) -> FastAPI:
    """The protocol's two paths, without the SDK's page of documentation, whose script is loaded
    from another host.
    """
    app = build_app(Walker(gateway), title="Wayfarer over MMCP")
    kept = ("/capabilities", "/generate")
    app.router.routes = [
        route for route in app.router.routes if isinstance(route, Route) and route.path in kept
    ]
    return app


class Walker(Backbone):
    """People who walk, as a model of the protocol."""

    def __init__(self, gateway: Gateway) -> None:
        self._gateway = gateway
        self._skeleton = skeletons.canonical(gateway.body_library.name)

    def capabilities(self) -> ModelSpec:
        """The capabilities, as the protocol defines them."""
        limit = min(DURATION_S, self._gateway.limits.clip_s)
        return ModelSpec(
            id=MODEL,
            fps=float(FPS),
            canonical_skeleton=self._skeleton,
            supports_retargeting=True,
            supported_constraints=["root_path"],
            native_clip_seconds=limit,
            recommended_max_duration_seconds=limit,
            limits=ProtocolLimits(
                max_duration_seconds=limit,
                max_num_samples=SAMPLES,
                max_constraints_per_request=1,
                max_request_bytes=self._gateway.limits.message_bytes,
            ),
        )

    async def generate(self, request: GenerateRequest) -> MotionResult:
        """Raises ProtocolError."""
        try:
            return await self._generated(request)
        except WayfarerError as error:
            code = next((c for kind, c in CODES.items() if isinstance(error, kind)), "")
            raise ProtocolError(code or "internal_error", str(error)) from None

    async def _generated(self, request: GenerateRequest) -> MotionResult:
        fps, count = request.fps(float(FPS)), request.total_frames
        try:
            bones = skeletons.read(request.skeleton)
            fit = skeletons.body_for(bones)
        except InvalidArgument as error:
            raise ProtocolError("invalid_skeleton", str(error)) from None
        options = request.options
        seed, samples = (options.seed, options.num_samples) if options else (None, 1)
        seeds = [segment.seed for segment in request.segments if segment.seed is not None]
        seed = seeds[0] if seeds else seed
        clips = []
        for number in range(samples):
            planned = plan(request, fps)
            agent = planned["agent"] | {"gender": fit.gender, "betas": fit.betas}
            if seed is not None:
                agent["seed"] = (seed + number) % (1 << 32)
            asked = schema.ClipRequest.model_validate(planned | {"agent": agent})
            clip = await self._gateway.motion.generate_motion(asked)
            clips.append(_cut(resampled(clip, fps), count))
        found = [await asyncio.to_thread(skeletons.retargeted, clip, bones) for clip in clips]
        feet = [bones.table().get(f"{side}_ankle", "") for side in ("left", "right")]
        contacts = np.stack([clip.contacts for clip in clips])
        return MotionResult(
            rotations=np.stack([rotations for rotations, _ in found]).astype(np.float32),
            root_translations=np.stack([roots for _, roots in found]).astype(np.float32),
            foot_contacts={foot: contacts[..., k] for k, foot in enumerate(feet)},
        )


def plan(request: GenerateRequest, fps: float) -> dict[str, Any]:
    """Start, goals and seconds of the clip in the glTF basis. Raises ProtocolError."""
    asked = [(_orders(segment), segment.duration_frames / fps) for segment in request.segments]
    paths = [c for c in request.constraints if isinstance(c, RootPathConstraint)]
    seconds = max(request.total_frames / fps, 0.2) + 1 / FPS
    agent, goals = _along(paths[0], fps) if paths else ({}, [])
    if not goals:  # no path, or only a start: clients pin the place where the character stands
        goals = _in_words(asked, agent)
    return {"agent": agent, "goals": goals, "seconds": seconds, "basis": "gltf"}


def _orders(segment: Any) -> list[Clause]:
    if segment.type == "unconditioned":
        return [Clause(SPEEDS[""])]
    try:
        return orders(segment.prompt)
    except ValueError as error:
        raise ProtocolError("invalid_request", str(error), {"prompt": segment.prompt}) from None


def _in_words(
    asked: list[tuple[list[Clause], float]], agent: dict[str, Any]
) -> list[dict[str, Any]]:
    """Goals one after the other, from where the agent stands. A clause without a distance has a
    share of the segment's time.
    """
    start, heading = agent.get("position", {}), agent.get("heading", 0.0)
    x, z = start.get("x", 0.0), start.get("z", 0.0)
    goals: list[dict[str, Any]] = []
    for clauses, seconds in asked:
        share = seconds / len(clauses)
        for order in clauses:
            if not order.speed:
                goals.append({"position": {"x": x, "y": 0.0, "z": z}, "dwell": min(share, 60.0)})
                continue
            if order.place is not None:
                heading = math.atan2(order.place[0] - x, order.place[1] - z)
                x, z = order.place
            else:
                far = order.speed * share if order.far is None else order.far
                heading += order.turn
                x, z = x + far * math.sin(heading), z + far * math.cos(heading)
            goals.append({"position": {"x": x, "y": 0.0, "z": z}, "speed": order.speed})
    return goals


def _along(path: RootPathConstraint, fps: float) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The agent at the first place of a path; goals at the others, at the speed between them."""
    places = np.array(path.positions_xz, float)
    if not np.isfinite(places).all():
        raise ProtocolError("invalid_request", "positions_xz must be finite")
    (x, z), times = places[0], np.array(path.frames) / fps
    agent: dict[str, Any] = {"position": {"x": x, "y": 0.0, "z": z}}
    if path.heading_radians is not None:
        agent["heading"] = math.remainder(path.heading_radians[0], math.tau)
    elif len(places) > 1:
        agent["heading"] = math.atan2(*(places[1] - places[0]))
    goals = []
    for k in range(1, len(places)):
        far = float(np.linalg.norm(places[k] - places[k - 1]))
        speed = min(max(far / (times[k] - times[k - 1]), SLOWEST), FASTEST)
        position = {"x": float(places[k][0]), "y": 0.0, "z": float(places[k][1])}
        is_last = k == len(places) - 1
        goals.append({"position": position, "speed": speed, "stop": is_last})
    return agent, goals


def _cut(clip: Clip, count: int) -> Clip:
    if clip.frames < count:
        raise InvalidArgument(f"{count} frames were asked for, and {clip.frames} could be made")
    return clip[:count]
