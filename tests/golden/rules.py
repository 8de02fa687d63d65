"""Traces of the rules of clients/README.md, made by the Python client from the server's data.

playout.json: arrival times of messages → the moment shown, and its pose. retarget.json: a character
at rest → its bones in the world, for frames of a walk (walk.json), which are included.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden.rigs import BONES, Case, cases, refused, shoes_of
from tests.golden.vectors import congruential, draw
from tests.wire_poses import quaternions_to_core, quaternions_to_wire
from wayfarer.transport.conversion.basis import Basis
from wayfarer_client.bases import BASES
from wayfarer_client.bone_map import map_bones
from wayfarer_client.errors import InvalidArgument
from wayfarer_client.playout import PlayoutClock, PoseTrack
from wayfarer_client.retarget import Retarget
from wayfarer_client.rig import Rig
from wayfarer_client.root import SmoothRoot
from wayfarer_client.soles import measure_soles

FOLDER = Path(__file__).parent
PLAYOUT = FOLDER / "playout.json"
RETARGET = FOLDER / "retarget.json"
WALK = json.loads((FOLDER / "walk.json").read_text())
CHUNK = 0.2
LASTS = {"settles": 36}
"""Seconds of a trace if not 12: longer than lateness is remembered."""
SHOWN = (0, 11, 17, 23, 42)
"""Frames of the walk that are put on characters: standing, steps, a turn."""


def arrivals(kind: str) -> Iterator[tuple[float, float, float]]:
    """(time it comes on a perfect clock, time sent, time its motion is for) of messages."""
    numbers = congruential(7)
    last = 0.0
    for k in range(int(LASTS.get(kind, 12) / CHUNK)):
        due = k * CHUNK
        late = {
            "steady": 0.0,
            "jitter": 0.1 * (next(numbers) + 1),
            "burst": 0.7 if k in (20, 21) else 0.0,
            "resumed": 3.0 - (due - 4.0) if 4.0 <= due < 7.0 else 0.0,
            "outage": 3.0 - (due - 4.0) if 4.0 <= due < 7.0 else 0.0,
            "far_clock": 0.02 * (next(numbers) + 1),
            "sleep": 0.0,
            "settles": 0.5 if k == 10 else 0.0,
        }[kind]
        last = max(last, due + late)  # messages of a connection stay in order
        yield last + 0.03, due + late, due


def clock_trace(kind: str) -> list[list[Any]]:
    """["message", now, sent_at], ["chunk", now, scheduled_at], ["resumed", now, sent_at] before the
    first of a new connection, ["show", now, moment, delay].
    """
    clock = PlayoutClock()
    local = {"far_clock": 86400.0, "sleep": -3.5}.get(kind, 500.0)
    server = 1_780_000_000.0 if kind == "far_clock" else 0.0
    waiting = list(arrivals(kind))
    events: list[list[Any]] = []
    seconds, per_second = LASTS.get(kind, 12), 4 if kind in LASTS else 30
    for picture in range(seconds * per_second):
        at = picture / per_second
        while waiting and waiting[0][0] <= at:
            came, sent, due = waiting.pop(0)
            clock.observe(local + came, server + sent)
            if kind == "resumed" and due == 4.0:
                clock.resumed(server + sent)
                events.append(["resumed", local + came, server + sent])
            clock.observe_chunk(local + came, server + due)
            events += [
                ["message", local + came, server + sent],
                ["chunk", local + came, server + due],
            ]
        if kind == "sleep" and 5 < at < 8:
            continue
        now = local + at
        moment = clock.advance(now)
        events.append(["show", now, moment, clock.delay(now)])
    return events


def track_trace(gap: bool) -> list[list[Any]]:
    """["push", time, fps, frames, contacts] and ["sample", time, *what is found].

    Found: pose or null, contacts, seconds buffered, underruns.
    """
    track = PoseTrack()
    numbers = congruential(11)
    events: list[list[Any]] = []

    def push(time: float, fps: int, count: int) -> None:
        hips = np.array([[3 * next(numbers) for _ in range(3)] for _ in range(count)], np.float32)
        turns = np.array([[draw(numbers), draw(numbers)] for _ in range(count)], np.float32)
        bits = np.arange(count, dtype=np.uint8) % 4
        track.push(time, fps, hips, turns, bits)
        frames = np.concatenate([hips, turns.reshape(count, -1)], 1)
        events.append(["push", time, fps, frames.tolist(), bits.tolist()])

    def sample(time: float) -> None:
        found = track.sample(time)
        pose = None
        if found:
            pose = [*found.translation, *found.rotations.ravel()]
            pose = [round(float(value), 6) for value in pose]
        bits = found.contacts if found else 0
        buffered = None if found is None else round(track.buffered(time), 9)
        events.append(["sample", time, pose, bits, buffered, track.underruns])

    sample(9.9)
    push(10.0, 20, 4)
    for time in (9.95, 10.0, 10.012, 10.05, 10.11):
        sample(time)
    push(10.1, 20, 4)  # the first two are known already
    for time in (10.13, 10.16, 10.24, 10.3, 10.42):
        sample(time)
    push(10.6 if gap else 10.3, 20, 6)
    for time in (10.43, 10.47, 10.52, 10.56, 10.63, 10.7):
        sample(time)
    return events


def root_trace() -> list[list[Any]]:
    """[time, hips, turn of the hips, ground, point, heading] of the recorded walk."""
    root = SmoothRoot(BASES["gltf"])
    events = []
    for k, (hips, turns) in enumerate(zip(WALK["hips"], WALK["rotations"], strict=True)):
        time, ground = k / WALK["fps"], 0.02 * k
        point, heading = root.update(time, np.array(hips), np.array(turns[:4]), ground)
        events.append([time, hips, turns[:4], ground, rounded(point), round(heading, 6)])
    return events


def rounded(values: Any, digits: int = 6) -> list[float]:
    return [round(float(value), digits) + 0.0 for value in values]


def walk_in(basis: Basis) -> dict[str, Any]:
    """Rest offsets and the frames `SHOWN`, by the server's own conversion."""

    def convert(values: Any, width: int) -> list[list[float]]:
        core = np.array(values, float).reshape(-1, width)
        gltf, axes = Basis.GLTF.axes, basis.axes
        if width == 3:
            return [rounded(row) for row in axes.points_to_wire(gltf.points_to_core(core))]
        return [rounded(row) for row in quaternions_to_wire(axes, quaternions_to_core(gltf, core))]

    return {
        "rest_offsets": convert(WALK["rest_offsets"], 3),
        "hips": [convert(WALK["hips"][k], 3)[0] for k in SHOWN],
        "rotations": [convert(WALK["rotations"][k], 4) for k in SHOWN],
    }


def retarget_case(case: Case, walk: dict[str, Any]) -> dict[str, Any]:
    basis = BASES[case.basis]
    bones = map_bones(case.rig, case.humanoid, basis)
    assert bones.found_by == case.found_by, f"{case.name}: {bones.found_by} {bones.table()}"
    mesh = soles = None
    if case.shod:
        places, owners = shoes_of(case.rig, dict(bones.bones), case.basis)
        mesh = {"places": [rounded(place) for place in places], "nodes": owners.tolist()}
        soles = measure_soles(bones, np.array(mesh["places"]), owners, basis)
        assert soles is not None, case.name
    retarget = Retarget(bones, np.array(walk["rest_offsets"]), basis, soles=soles)
    poses = []
    for hips, rotations in zip(walk["hips"], walk["rotations"], strict=True):
        pose = retarget.pose(np.array(hips), np.array(rotations))
        poses.append(
            {
                "rotations": {BONES[b]: rounded(q, 5) for b, q in pose.rotations.items()},
                "places": {BONES[b]: rounded(p, 5) for b, p in pose.places.items()},
                "moved": {BONES[b]: rounded(p, 5) for b, p in pose.moved.items()},
            }
        )
    return {
        "name": case.name,
        "basis": case.basis,
        "nodes": nodes_of(case.rig),
        "humanoid": case.humanoid,
        "found_by": bones.found_by,
        "map": bones.table(),
        "mesh": mesh,
        "floor": None if soles is None else round(soles.floor, 6),
        "ratio": round(retarget.ratio, 6),
        "poses": poses,
    }


def nodes_of(rig: Rig) -> list[dict[str, Any]]:
    return [
        {
            "name": node.name,
            "parent": node.parent,
            "position": rounded(node.position, 7),
            "rotation": rounded(node.rotation, 9),
            "scale": rounded(node.scale),
        }
        for node in rig.nodes
    ]


def refusal_case(name: str, rig: Rig, says: str) -> dict[str, Any]:
    try:
        map_bones(rig)
    except InvalidArgument as error:
        assert says in str(error), f"{name}: {error}"
        return {"name": name, "nodes": nodes_of(rig), "says": says}
    raise AssertionError(f"{name} is taken")


def files() -> dict[Path, bytes]:
    """Content of playout.json and retarget.json."""
    kinds = ("steady", "jitter", "burst", "outage", "resumed", "far_clock", "sleep", "settles")
    playout = {
        "about": "See README.md. Times: seconds; a pose: hips x, y, z, then x, y, z, w per bone.",
        "clock": {kind: clock_trace(kind) for kind in kinds},
        "track": {"joined": track_trace(False), "gap": track_trace(True)},
        "root": root_trace(),
    }
    drawn = cases()
    walks = {basis: walk_in(Basis(basis)) for basis in sorted({case.basis for case in drawn})}
    retarget = {
        "about": "See README.md. Quaternions are x, y, z, w.",
        "bones": list(BONES),
        "walk": walks,
        "cases": [retarget_case(case, walks[case.basis]) for case in drawn],
        "refused": [refusal_case(*case) for case in refused()],
    }
    return {PLAYOUT: _lines(playout).encode(), RETARGET: _lines(retarget).encode()}


def _lines(document: dict[str, Any]) -> str:
    """JSON with one entry of the inner lists per line, so that a change can be read."""

    def inner(value: Any, depth: int) -> str:
        pad = "\n" + " " * depth
        if depth < 3 and isinstance(value, dict):
            rows = [f"{json.dumps(key)}: {inner(entry, depth + 1)}" for key, entry in value.items()]
            return "{" + pad + f",{pad}".join(rows) + "\n" + " " * (depth - 1) + "}"
        if depth < 4 and isinstance(value, list) and value and isinstance(value[0], list | dict):
            rows = [inner(entry, depth + 1) if depth < 3 else json.dumps(entry) for entry in value]
            return "[" + pad + f",{pad}".join(rows) + "\n" + " " * (depth - 1) + "]"
        return json.dumps(value)

    return inner(document, 1) + "\n"
