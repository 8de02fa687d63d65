"""Schema ↔ runtime: values in a session's basis ↔ messages in world space."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import lru_cache
from hashlib import sha256
from typing import Any, Final, assert_never

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.outfit import check_outfit, look
from wayfarer.body.phenotype import LIMITS
from wayfarer.body.skeleton import load_skeleton, parents
from wayfarer.clips.files import FileOptions
from wayfarer.engines.models import ModelInfo
from wayfarer.errors import (
    Heading,
    InvalidArgument,
    Metres,
    MetresPerSecond,
    Place,
    Quantity,
    Text,
    Unreachable,
)
from wayfarer.runtime.stats import LoopStats
from wayfarer.spec import BETAS, POSED_JOINTS
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoding, PoseFormat
from wayfarer.transport.conversion.basis import Axes, Basis
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.conversion.motion_files import file_fields
from wayfarer.transport.conversion.units import in_world, on_wire, place, vector
from wayfarer.transport.streams.detail_levels import DetailRing, ViewPlace
from wayfarer.world.agents import agent as runtime

MAX_VIEW_DISTANCE: Final = 1e6
"""Maximum distance of a camera from the origin along each axis, in metres."""

REACH: Final = 0.01, 100.0
"""Minimum and maximum of a viewpoint's `reach`."""

UNITS: Final = {1.0: "m", 0.01: "cm"}
"""Names of the bases' units of length."""


@contextmanager
def in_basis(axes: Axes) -> Iterator[None]:
    """Converts the lengths and places in errors to this basis: refused values, and the nearest
    place that can be reached.
    """
    try:
        yield
    except Unreachable as error:
        nearest = vector(axes.points_to_wire(np.array(error.nearest)))
        text = written(error.text, axes)
        raise Unreachable(text, (nearest.x, nearest.y, nearest.z)) from None
    except InvalidArgument as error:
        raise InvalidArgument(written(error.text, axes), error.field) from None


def written(text: Text, axes: Axes) -> str:
    """The sentence with its lengths and places in this basis."""
    return text.written(lambda quantity: _written(quantity, axes))


def _written(quantity: Quantity, axes: Axes) -> str:
    unit = UNITS[axes.metres_per_unit]
    match quantity:
        case Metres(metres):
            return f"{axes.length_to_wire(metres):g} {unit}"
        case MetresPerSecond(speed):
            return f"{axes.length_to_wire(speed):g} {unit}/s"
        case Heading(radians):
            return f"{axes.heading_to_wire(radians):g}"
        case Place(point):
            found = axes.points_to_wire(np.array(point)) + 0.0  # + 0.0: no negative zero
            return f"({', '.join(f'{value:g}' for value in found)})"
        case never:
            assert_never(never)


def basis_info(basis: Basis) -> schema.BasisInfo:
    """A basis in numbers."""
    axes = basis.axes
    return schema.BasisInfo(
        basis=basis,
        metres_per_unit=axes.metres_per_unit,
        right_handed=axes.handedness > 0,
        up=vector(axes.up),
        forward=vector(axes.forward),
    )


def agent_spec(
    spec: schema.AgentSpec, basis: Basis, bodies: BodyLibrary, seed: int
) -> runtime.AgentSpec:
    """The agent to create; `seed` is used if the client gave none."""
    axes = basis.axes
    betas: NDArray[np.floating[Any]] = np.array(spec.betas or (0.0,) * BETAS)
    if spec.phenotype is not None:
        betas = bodies.betas(spec.gender, spec.phenotype.model_dump(exclude_none=True))
    x = y = floor = 0.0
    if spec.position is not None:
        x, y, floor = place(spec.position, axes)
    return runtime.AgentSpec(
        gender=spec.gender,
        betas=tuple(float(beta) for beta in betas),
        position=(x, y),
        heading=axes.heading_to_core(spec.heading),
        noise_seed=seed if spec.seed is None else spec.seed,
        name=spec.name,
        foot_lock=spec.foot_lock,
        floor=floor,
        model=spec.model,
        outfit=check_outfit(spec.outfit),
    )


def agent(info: runtime.AgentInfo, basis: Basis, bodies: BodyLibrary) -> schema.Agent:
    """Describes an agent for its client."""
    axes, spec = basis.axes, info.spec
    return schema.Agent(
        agent_id=info.agent_id,
        alias=info.alias,
        session_id=info.session_id,
        name=spec.name,
        body=bodies.name,
        gender=schema.Gender(spec.gender),
        betas=spec.betas,
        seed=spec.noise_seed,
        state=info.state,
        position=vector(axes.points_to_wire(np.array(info.position, dtype=float))),
        heading=axes.heading_to_wire(info.heading),
        goal=None if info.goal is None else schema.Goal(**on_wire(schema.Goal, info.goal, axes)),
        goal_revision=info.goal_revision,
        created_at_us=microseconds(info.created_at),
        rest_offsets=rest_offsets(bodies, spec.gender, spec.betas, basis),
        waypoint=info.waypoint,
        waypoints=info.waypoints,
        foot_lock=spec.foot_lock,
        model=info.model,
        outfit=look(spec.noise_seed, spec.gender, spec.outfit).outfit,
    )


def drawn_seed(session_seed: int, number: int) -> int:
    """The seed of the `number`-th agent of a session, from 0, that was created without a seed."""
    drawn = sha256(f"{session_seed}/{number}".encode()).digest()
    return int.from_bytes(drawn[:4], "little")


def pose_format(request: schema.PoseFormat) -> PoseFormat:
    """Checks the choice of a pose format. Raises InvalidArgument that names the part at fault."""
    if request.encoding is PoseEncoding.ROOT:
        allowed = ", ".join(e.upper() for e in PoseEncoding if e is not PoseEncoding.ROOT)
        raise InvalidArgument(f"ROOT is for streams; here is one of {allowed}", "format.encoding")
    return stream_format(request)


def stream_format(request: schema.PoseFormat, field: str = "format") -> PoseFormat:
    """Like `pose_format`, for a stream, which may carry roots instead of poses."""
    chosen = (request.encoding, request.profile, request.bones, request.fps)
    return PoseFormat.choose(*chosen, field=field)


def rings(request: schema.Interest, usual: PoseFormat, axes: Axes) -> list[DetailRing]:
    """The rings of a stream; `usual` is the stream's own format. Raises InvalidArgument."""
    found: list[DetailRing] = []
    for k, ring in enumerate(request.rings):
        where = f"interest.rings[{k}]"
        radius, least = axes.length_to_core(ring.radius), found[-1].radius if found else 0.0
        if not schema.MIN_RADIUS <= radius <= schema.MAX_RADIUS:
            allowed = f"{_written(Metres(schema.MIN_RADIUS), axes)} to "
            allowed += _written(Metres(schema.MAX_RADIUS), axes)
            raise InvalidArgument(f"is {ring.radius:g}; allowed: {allowed}", f"{where}.radius")
        if radius <= least:
            raise InvalidArgument("is not greater than the one before", f"{where}.radius")
        packed = stream_format(ring.format, f"{where}.format") if ring.format else usual
        found.append(DetailRing(radius, packed))
    return found


def viewpoints(
    request: Iterable[schema.Viewpoint], axes: Axes, field: str = "viewpoints"
) -> list[ViewPlace]:
    """Viewpoints in world space. Raises InvalidArgument."""
    found = []
    for k, view in enumerate(request):
        where = f"{field}[{k}]"
        position = place(view.position, axes)
        if max(map(abs, position)) > MAX_VIEW_DISTANCE:
            most = _written(Metres(MAX_VIEW_DISTANCE), axes)
            raise InvalidArgument(f"is more than {most} from the origin", f"{where}.position")
        if view.reach and not REACH[0] <= view.reach <= REACH[1]:
            allowed = f"{REACH[0]:g} to {REACH[1]:g}, or 0 for 1"
            raise InvalidArgument(f"is {view.reach:g}; allowed: {allowed}", f"{where}.reach")
        found.append(ViewPlace(position, view.reach or 1.0))
    return found


def model(info: ModelInfo) -> schema.Model:
    """A catalogue entry."""
    return schema.Model(**asdict(info))


def skeleton() -> schema.Skeleton:
    """The bones of all agents."""
    bones = tuple(
        schema.Bone(name=b.name, parent=p, mixamo=b.mixamo, unity=b.unity, vrm=b.vrm, ue=b.ue)
        for b, p in zip(load_skeleton(), parents(), strict=True)
    )
    return schema.Skeleton(bones=bones, posed_bones=POSED_JOINTS)


def body(bodies: BodyLibrary, gender: schema.Gender) -> schema.Body:
    """A catalogue entry."""
    model = bodies.model(gender)
    least, greatest = LIMITS["height_m"]
    return schema.Body(
        name=bodies.name,
        gender=gender,
        betas=model.betas,
        vertices=len(model.bind_vertices),
        faces=len(model.faces),
        min_height_m=least,
        max_height_m=greatest,
        glb_path=f"/v1/bodies/{bodies.name}-{gender}.glb",
    )


def file_options(request: schema.MotionFile) -> FileOptions:
    """Raises InvalidArgument if options contradict each other."""
    with file_fields():
        return FileOptions(**dict(request))


def fitted_body(request: schema.CharacterJoints, bodies: BodyLibrary) -> schema.FittedBody:
    """The body with a character's proportions. Raises InvalidArgument."""
    axes = request.basis.axes
    joints: dict[str, NDArray[np.floating[Any]]] = {}
    for k, joint in enumerate(request.joints):
        if joint.bone in joints:
            raise InvalidArgument(f"{joint.bone!r} is there twice", f"joints[{k}].bone")
        joints[joint.bone] = np.array(place(joint.position, axes))
    found = bodies.fit(joints, in_world(dict[str, Any], request, axes).get("floor"), request.gender)
    return schema.FittedBody(
        body=bodies.name,
        gender=schema.Gender(found.gender),
        betas=found.betas,
        scale=found.scale,
        lengths=tuple(
            schema.FittedLength(**asdict(length), error_cm=length.error_cm)
            for length in found.lengths
        ),
    )


def stats(figures: LoopStats) -> schema.Stats:
    """Converts each field."""
    return schema.Stats(**asdict(figures))


@lru_cache(maxsize=1024)
def rest_offsets(
    bodies: BodyLibrary, gender: str, betas: tuple[float, ...], basis: Basis
) -> tuple[float, ...]:
    """J × 3 numbers: the offset of each joint from its parent in the T-pose, in the basis."""
    body = bodies.model(gender, "low")
    joints = body.rest_joints(np.array(betas))
    offsets = joints.copy()
    offsets[1:] -= joints[body.parents[1:]]
    wire = basis.axes.points_to_wire(offsets)
    return tuple(round(float(value), 6) for value in wire.ravel())


def microseconds(seconds: float) -> int:
    """Unix seconds → microseconds since the Unix epoch."""
    return round(seconds * 1e6)
