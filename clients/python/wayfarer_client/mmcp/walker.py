"""People who walk, as a model of the protocol (the extra `mmcp`).

A request's words (prompts.py) or its root path become goals. The person that walks has the
proportions of the request's skeleton, and the motion is retargeted to that skeleton.
"""

import asyncio
import math
from dataclasses import replace
from typing import Any, Final, Self

import numpy as np
from motionmcp import Backbone, GenerateRequest, ModelSpec, MotionResult
from motionmcp.backbone import Limits as ProtocolLimits
from motionmcp.errors import ProtocolError
from motionmcp.schemas import RootPathConstraint

from wayfarer_client.client import Client
from wayfarer_client.errors import (
    InvalidArgument,
    PermissionDenied,
    ResourceExhausted,
    Unavailable,
    WayfarerError,
)
from wayfarer_client.messages import AgentSpec, Goal
from wayfarer_client.mmcp import skeletons
from wayfarer_client.mmcp.prompts import SPEEDS, Clause, orders
from wayfarer_client.quaternions import slerp
from wayfarer_client.tracks import Track, tracks

MODEL: Final = "wayfarer"
MAX_SAMPLES: Final = 4
MAX_SECONDS: Final = 30.0
MAX_FPS: Final = 240.0
MIN_SPEED, MAX_SPEED = 0.2, 4.0
FPS: Final = 40
"""Frames per second of a clip."""
CODES: Final = {
    PermissionDenied: "forbidden",
    ResourceExhausted: "resource_exhausted",
    Unavailable: "model_unavailable",
    InvalidArgument: "invalid_request",
}


class Walker(Backbone):
    """The people of a server."""

    def __init__(self, client: Client, spec: ModelSpec) -> None:
        """`spec`: the capabilities, as the protocol defines them."""
        self._client, self._spec = client, spec

    @classmethod
    async def of(cls, client: Client) -> Self:
        """As its server is: the skeleton is that of its mean body. Raises WayfarerError."""
        limits = (await client.server_info()).limits
        longest = min(MAX_SECONDS, limits.clip_s)
        mean = await _walk(client, AgentSpec(), [], 0.2)
        skeleton = skeletons.canonical(await client.skeleton(), mean.agent.rest_offsets)
        spec = ModelSpec(
            id=MODEL,
            fps=float(FPS),
            canonical_skeleton=skeleton,
            supports_retargeting=True,
            supported_constraints=["root_path"],
            native_clip_seconds=longest,
            recommended_max_duration_seconds=longest,
            limits=ProtocolLimits(
                max_duration_seconds=longest,
                max_num_samples=MAX_SAMPLES,
                max_constraints_per_request=1,
                max_request_bytes=limits.message_bytes,
            ),
        )
        return cls(client, spec)

    def capabilities(self) -> ModelSpec:
        """The capabilities, as the protocol defines them."""
        return self._spec

    async def generate(self, request: GenerateRequest) -> MotionResult:
        """Raises ProtocolError."""
        try:
            return await self._generated(request)
        except WayfarerError as error:
            code = next((c for kind, c in CODES.items() if isinstance(error, kind)), "")
            raise ProtocolError(code or "internal_error", str(error)) from None

    async def _generated(self, request: GenerateRequest) -> MotionResult:
        fps, count = request.fps(float(FPS)), request.total_frames
        if not 1 <= fps <= MAX_FPS:
            raise InvalidArgument(f"fps is {fps:g}; allowed are 1 to {MAX_FPS:g}")
        try:
            bones = skeletons.read(request.skeleton)
            fit = await self._client.fit_body(bones)
        except InvalidArgument as error:
            raise ProtocolError("invalid_skeleton", str(error)) from None
        options = request.options
        seed, samples = (options.seed, options.num_samples) if options else (None, 1)
        seeds = [segment.seed for segment in request.segments if segment.seed is not None]
        seed = seeds[0] if seeds else seed
        agent, goals = plan(request, fps)
        agent = replace(agent, gender=fit.gender, betas=fit.betas)
        seconds = max(count / fps, 0.2) + 1 / FPS
        clips = []
        for number in range(samples):
            own = None if seed is None else (seed + number) % (1 << 32)
            clip = await _walk(self._client, replace(agent, seed=own), goals, seconds)
            clips.append(_resampled(clip, fps, count))
        found = [await asyncio.to_thread(skeletons.retargeted, clip, bones) for clip in clips]
        feet = [bones.table().get(f"{side}_ankle", "") for side in ("left", "right")]
        contacts = np.stack([clip.contacts for clip in clips])
        return MotionResult(
            rotations=np.stack([rotations for rotations, _ in found]).astype(np.float32),
            root_translations=np.stack([roots for _, roots in found]).astype(np.float32),
            foot_contacts={foot: contacts[..., k] for k, foot in enumerate(feet)},
        )


async def _walk(client: Client, agent: AgentSpec, goals: list[Goal], seconds: float) -> Track:
    """The motion of a clip in the glTF basis."""
    batches = [batch async for batch in client.generate_clip(agent, goals, seconds)]
    (track,) = tracks(batches).values()
    return track


def plan(request: GenerateRequest, fps: float) -> tuple[AgentSpec, list[Goal]]:
    """Start and goals of the clip in the glTF basis. Raises ProtocolError."""
    clauses = [(_orders(segment), segment.duration_frames / fps) for segment in request.segments]
    paths = [c for c in request.constraints if isinstance(c, RootPathConstraint)]
    agent, goals = _along(paths[0], fps) if paths else (AgentSpec(), [])
    # no path, or only a start: clients pin the place where the character stands
    return agent, goals or _in_words(clauses, agent)


def _orders(segment: Any) -> list[Clause]:
    if segment.type == "unconditioned":
        return [Clause(SPEEDS[""])]
    try:
        return orders(segment.prompt)
    except ValueError as error:
        raise ProtocolError("invalid_request", str(error), {"prompt": segment.prompt}) from None


def _in_words(segments: list[tuple[list[Clause], float]], agent: AgentSpec) -> list[Goal]:
    """Goals one after the other, from where the agent stands. A clause without a distance has a
    share of the segment's time.
    """
    (x, _, z), heading = agent.position, agent.heading
    goals: list[Goal] = []
    for clauses, seconds in segments:
        share = seconds / len(clauses)
        for order in clauses:
            if not order.speed:
                goals.append(Goal((x, 0.0, z), dwell=min(share, 60.0)))
                continue
            if order.place is not None:
                heading = math.atan2(order.place[0] - x, order.place[1] - z)
                x, z = order.place
            else:
                far = order.speed * share if order.far is None else order.far
                heading += order.turn
                x, z = x + far * math.sin(heading), z + far * math.cos(heading)
            goals.append(Goal((x, 0.0, z), speed=order.speed))
    return goals


def _along(path: RootPathConstraint, fps: float) -> tuple[AgentSpec, list[Goal]]:
    """The agent at the first place of a path; goals at the others, at the speed between them."""
    places = np.array(path.positions_xz, float)
    if not np.isfinite(places).all():
        raise ProtocolError("invalid_request", "positions_xz must be finite")
    times, heading = np.array(path.frames) / fps, 0.0
    if path.heading_radians is not None:
        heading = math.remainder(path.heading_radians[0], math.tau)
    elif len(places) > 1:
        heading = math.atan2(*(places[1] - places[0]))
    ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
    speeds = np.clip(ways / np.diff(times), MIN_SPEED, MAX_SPEED)
    goals = [
        Goal((x, 0.0, z), speed=speed, stop=k == len(speeds))
        for k, ((x, z), speed) in enumerate(zip(places[1:].tolist(), speeds, strict=True), 1)
    ]
    x, z = places[0].tolist()
    return AgentSpec(position=(x, 0.0, z), heading=heading), goals


def _resampled(track: Track, fps: float, count: int) -> Track:
    """The first `count` frames at another rate: straight lines and shortest arcs between frames.

    Raises InvalidArgument if the motion ends before.
    """
    at = np.arange(count) / fps * FPS
    last = len(track.times) - 1
    if round(at[-1], 6) > last:
        made = int(last / FPS * fps) + 1
        raise InvalidArgument(f"{count} frames were asked for, and {made} could be made")
    before = np.minimum(at.astype(int), max(last - 1, 0))
    after, share = np.minimum(before + 1, last), (at - before)[:, None]
    places, turns = track.translation, np.asarray(track.rotations, float)
    return replace(
        track,
        times=at / FPS,
        translation=places[before] * (1 - share) + places[after] * share,
        rotations=slerp(turns[before], turns[after], share[..., None]),
        contacts=track.contacts[np.where(share[:, 0] < 0.5, before, after)],
    )
