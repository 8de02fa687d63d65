"""`wayfarer.json`, which documents every input, output and constant, and README.md made of it."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from math import degrees
from typing import Any, Final

import onnx
from onnx import TensorProto

from wayfarer import __version__
from wayfarer.body import landmarks, skeleton
from wayfarer.body.model import BodyModel
from wayfarer.body.skeleton import joint_names, parents
from wayfarer.spec import FPS, NEW_FRAMES, POSED_JOINTS, SEED_FRAMES, STEP_SECONDS
from wayfarer.terms import TERMS
from wayfarer.world.agents.slots import Mode
from wayfarer.world.goals.steering import Steering
from wayfarer_lab.engine_export.bodies import BodyTensor
from wayfarer_lab.engine_export.graph import IR_VERSION, OPSET, operators, shape_of

SCHEMA: Final = 1
SIDECAR: Final = "wayfarer.json"
PAGE: Final = "README.md"

FRAME: Final = "world: metres, right-handed, Z up; heading 0 faces +Y; headings grow about +Z"

AXES: Final = {
    "seed_markers": "person, frame (oldest first), marker (order: markers), x y z",
    "seed_translation": "person, frame (oldest first), x y z",
    "seed_rotations": "person, frame (oldest first), joint (order: joints), x y z w",
    "betas": "person, coefficient",
    "goal": "person, x y z",
    "target_speed": "person",
    "facing": "person, x y",
    "term_weights": "person, term (order: terms)",
    "policy": "person",
    "noise": "person, candidate, latent",
    "manner": "person, number",
    "obstacles": "person, obstacle, ax ay bx by vx vy radius",
    "translation": "person, frame (in order of time), x y z",
    "rotations": "person, frame, joint (order: joints), x y z w",
    "contacts": "person, frame, left right",
    "next_seed_markers": "person, frame (oldest first), marker (order: markers), x y z",
}

UNITS: Final = {
    "seed_rotations": "unit quaternion",
    "rotations": "unit quaternion",
    "betas": "standard deviations, -5 to 5",
    "target_speed": "m/s",
    "facing": "unit vector, or 0 0",
    "term_weights": "1",
    "policy": "1, 0 to 1",
    "noise": "1",
    "manner": "1",
    "obstacles": "m and m/s",
    "contacts": "0 or 1",
}
"""The others are in metres."""

MEANINGS: Final = {
    "seed_markers": "markers on the skin in the last two frames; at first `start_markers`, later "
    "`next_seed_markers` of the step before",
    "seed_translation": "hips joint in the same two frames; later the last two of `translation`",
    "seed_rotations": "rotations in the same two frames: joint 0 in the world, all others relative "
    "to their parents and to the T-pose; later the last two of `rotations`",
    "betas": "shape of the body; all 0 is the mean of its gender",
    "goal": "point on the floor to walk to, z = 0; see `steering`",
    "target_speed": "horizontal speed wished for; 0 when the person does not walk",
    "facing": "what the body should face; 0 0 while walking: the way to the goal",
    "term_weights": "weights of the quality terms, which tell the policy what the person is doing: "
    "a row of `modes`",
    "policy": "share of the learned policy in the latents: 1",
    "noise": "128 numbers from N(0, 1), new ones for each step, times the mode's `temperature`. "
    "For people who differ: sqrt(1 - own) times new ones + sqrt(own) times 128 numbers that each "
    "person keeps for ever; `own` is the mode's",
    "manner": "8 numbers from N(0, 1) that a person keeps for ever: how it moves whatever it does",
    "obstacles": "what is near, as lines from a to b with a radius that move evenly; a radius "
    "below 0 is none",
    "translation": "hips joint in the 8 new frames, 40 a second",
    "rotations": "rotations in the 8 new frames, as in `seed_rotations`",
    "contacts": "1 where the foot touches the floor and is still",
    "next_seed_markers": "`seed_markers` of the next step",
}

STEERING: Final[Mapping[str, tuple[str, str]]] = {
    "braking_seconds": ("s", "braking distance = min(radius / 2, braking_margin) + this * speed"),
    "braking_margin": ("m", "see braking_seconds"),
    "coasting_seconds": ("s", "without a goal a person comes to rest in this * speed"),
    "pausing": ("1", "share of the asked speed, of 0.7 m/s at most: slower, a walker stops there"),
    "slow": ("m/s", "below this a person counts as slow"),
    "slow_seconds": ("s", "who has been slow for this long while STOPPING is STANDING"),
    "resume_margin": ("m", "stopped or pushed this far outside the radius: walk again"),
    "lookahead": ("m", "a point to pass through is aimed at so far ahead"),
    "lookahead_seconds": ("s", "or as far as this * speed, if that is farther"),
    "faced": ("rad", "a turn ends when the heading is met within this"),
    "astray": ("rad", "and begins when it is missed by more"),
    "reactions": ("steps", "who stands sets off at one step in this many only, each at another"),
    "turn_radius": ("m", "who turns on the spot aims so far off it, halfway to the heading"),
    "turn_speed": ("m/s", "and steps so fast: asked for no way, a body turns like a turntable"),
    "climbing": ("1/s", "steps on stairs (not here)"),
    "strafe_speed": ("m/s", "at most of people who face elsewhere than where they go"),
    "strafe_slowest": ("m/s", "at least of them: asked for less, a body glides"),
    "weight_shift": ("m", "a standing person is asked so far to either side, and shifts weight"),
}


def sidecar(
    *,
    model: str,
    graphs: Mapping[str, onnx.ModelProto],
    bodies: Mapping[str, BodyModel],
    parts: Mapping[str, Sequence[BodyTensor]],
    files: Mapping[str, Mapping[str, Any]],
    candidates: int,
    differences: Mapping[str, float],
    steering: Steering,
) -> dict[str, Any]:
    """All that a host needs to know, as JSON. Graphs, bodies and parts by gender, files by name.

    Raises KeyError when a field of `Steering`, an input or an output is not described here.
    """
    first = next(iter(graphs.values()))
    body = next(iter(bodies.values()))
    names = joint_names()[:POSED_JOINTS]
    return {
        "schema": SCHEMA,
        "made_by": f"wayfarer {__version__}, wayfarer export",
        "model": model,
        "body": body.name,
        "frame": FRAME,
        "frames_per_second": FPS,
        "frames_per_step": NEW_FRAMES,
        "step_seconds": STEP_SECONDS,
        "seed_frames": SEED_FRAMES,
        "candidates": candidates,
        "opset": OPSET,
        "ir_version": IR_VERSION,
        "operators": operators(first),
        "largest_difference_from_the_server": dict(differences),
        "files": dict(files),
        "inputs": [_tensor(value) for value in first.graph.input],
        "outputs": [_tensor(value) for value in first.graph.output],
        "markers": list(body.marker_names),
        "sole_markers": body.sole_markers.reshape(2, -1).tolist(),
        "mirrored_markers": [
            body.marker_names.index(landmarks.mirrored(name)) for name in body.marker_names
        ],
        "mirrored_joints": [names.index(skeleton.mirrored(name)) for name in names],
        "joints": [
            {"name": name, "parent": parent}
            for name, parent in zip(names, parents()[:POSED_JOINTS], strict=True)
        ],
        "terms": list(TERMS),
        "modes": _modes(steering),
        "steering": {
            f.name: _constant(getattr(steering, f.name), *STEERING[f.name])
            for f in fields(steering)
            if f.name != "searches"
        },
        "bodies": {gender: _layout(gender, found) for gender, found in parts.items()},
    }


def _tensor(value: onnx.ValueInfoProto) -> dict[str, Any]:
    kind = TensorProto.DataType.Name(value.type.tensor_type.elem_type).lower()
    return {
        "name": value.name,
        "dtype": "float32" if kind == "float" else kind,
        "shape": shape_of(value),
        "axes": AXES[value.name],
        "unit": UNITS.get(value.name, "m"),
        "frame": FRAME if "m" in UNITS.get(value.name, "m").split() else "",
        "meaning": MEANINGS[value.name],
    }


def _constant(value: float, unit: str, meaning: str) -> dict[str, Any]:
    shown = {"degrees": round(degrees(value), 6)} if unit == "rad" else {}
    return {"value": value, "unit": unit, **shown, "meaning": meaning}


def _modes(steering: Steering) -> dict[str, Any]:
    found = {}
    for mode, search in steering.searches.items():
        table = dict(search.weights)
        found[mode.name] = {
            "term_weights": [table.get(term, 0.0) for term in TERMS],
            "policy": search.policy,
            "temperature": search.temperature,
            "own": search.own,
        }
    return {mode.name: found[mode.name] for mode in Mode}


def body_file_name(gender: str) -> str:
    """File of a body's numbers."""
    return f"body_{gender}.bin"


def _layout(gender: str, parts: Sequence[BodyTensor]) -> dict[str, Any]:
    offset, found = 0, []
    for part in parts:
        found.append(
            {
                "name": part.name,
                "dtype": "float32, little-endian",
                "shape": list(part.values.shape),
                "offset": offset,
                "bytes": part.values.nbytes,
                "unit": part.unit,
                "meaning": part.meaning,
            }
        )
        offset += part.values.nbytes
    return {"file": body_file_name(gender), "parts": found}


def page(about: Mapping[str, Any]) -> str:
    """README.md of an exported folder."""
    worst = max(about["largest_difference_from_the_server"].values())
    sizes = "\n".join(
        f"| `{name}` | {entry['bytes'] / 1e6:.1f} MB | {entry['meaning']} |"
        for name, entry in about["files"].items()
    )
    modes = "\n".join(
        f"| {name} | {', '.join(f'{w:g}' for w in mode['term_weights'])} | "
        f"{mode['temperature']:g} | {mode['own']:g} |"
        for name, mode in about["modes"].items()
    )
    constants = "\n".join(
        f"| `{name}` | {entry['value']:.6g} {entry['unit']} | {entry['meaning']} |"
        for name, entry in about["steering"].items()
    )
    layout = next(iter(about["bodies"].values()))
    parts = "\n".join(
        f"| `{p['name']}` | {_shape(p['shape'])} | {p['offset']} | {p['unit']} | {p['meaning']} |"
        for p in layout["parts"]
    )
    left, right = about["sole_markers"]
    return _PAGE.format(
        model=about["model"],
        made_by=about["made_by"],
        candidates=about["candidates"],
        opset=about["opset"],
        ir_version=about["ir_version"],
        weights="The graphs share `halves.bin` (float16 inside the file, float32 in use)"
        if "halves.bin" in about["files"]
        else "Each graph is one file: weights inside",
        worst=f"{worst:.1g}",
        frame=about["frame"],
        files=sizes,
        inputs=_table(about["inputs"]),
        outputs=_table(about["outputs"]),
        markers=", ".join(f"{i} {name}" for i, name in enumerate(about["markers"])),
        left=", ".join(map(str, left)),
        right=", ".join(map(str, right)),
        joints=", ".join(
            f"{i} {joint['name']}" + (f" ({joint['parent']})" if i else "")
            for i, joint in enumerate(about["joints"])
        ),
        terms=", ".join(about["terms"]),
        modes=modes,
        constants=constants,
        parts=parts,
        operators=", ".join(f"{name} {count}" for name, count in about["operators"].items()),
    )


def _table(tensors: Sequence[Mapping[str, Any]]) -> str:
    return "\n".join(
        f"| `{t['name']}` | {_shape(t['shape'])} | {t['unit']} | {t['axes']} | {t['meaning']} |"
        for t in tensors
    )


def _shape(sizes: Sequence[int | str]) -> str:
    return " × ".join(map(str, sizes)) or "1"


_PAGE: Final = """\
# {model} for game engines

Made by {made_by}. `wayfarer.json` holds everything on this page for programs.

One call of a graph moves any number of people of one gender by 0.2 s: 8 frames at 40 a second. All
tensors are float32. Frame of all places and directions: {frame}. The floor is z = 0.

| file | size | holds |
|---|---|---|
{files}

{weights}, opset {opset}, IR {ir_version},
{candidates} candidate(s), no custom operators. Before this folder was written, onnx.checker passed
each graph, its operators were found in Unity's table (Sentis 2.1 and later), and ONNX Runtime,
which is what Unreal's NNERuntimeORT is, gave the server's motion for walking people: largest
difference {worst} (m, and components of quaternions). The graphs have not been run inside Unity or
Unreal.

## Inputs
`agents` is the number of people in the call, any from 1.

| name | shape | unit | axes | meaning |
|---|---|---|---|---|
{inputs}

## Outputs
| name | shape | unit | axes | meaning |
|---|---|---|---|---|
{outputs}

## One step
1. The host decides what the person is doing: one of `modes`, a place `goal`, a `target_speed`, a
   `facing` (next section).
2. It runs the graph and shows the 8 frames of `translation` and `rotations` at 40 a second.
3. It keeps `next_seed_markers` and the last 2 frames of `translation` and `rotations`: they are the
   seed of the next step. Nothing that is done to what is shown may go back into the seed.

To start, take one of the start poses P with betas b:
`markers = start_markers[P] + start_markers_dirs[P] · b`, `turns = start_rotations[P]`. For a
heading h turn the markers about +Z by h and multiply turns[0] from the left by (0, 0, sin h/2,
cos h/2). The hips are at (x, y, z) with z = −(lowest z of the sole markers); add that to all
markers. Both frames of the seed are the same.

## What the host decides
The rules of the server for a person with one goal to stop at, in the units of this page. A new goal
begins with `mode = WALKING, arrived = false`. Constants are those below; angles are between
directions on the floor; `hips` is the last place of the hips, `facing_of_hips` the horizontal
direction (−2(xy + zw), 1 − 2(y² + z²)) of the last rotation of joint 0, made a unit vector.

```text
before each step
    way = goal - hips;  distance = |way|;  direction = way / distance
    braking = min(radius / 2, braking_margin) + braking_seconds * speed
    slow_now = speed < slow
    slow_for = slow_for + 0.2 if STANDING or (STOPPING and slow_now) else 0
    still = STOPPING and slow_for >= slow_seconds
    rests = still or STANDING or TURNING or (WALKING and slow_now)
    paused = WALKING and speed < pausing * min(wished, 0.7)
    far = distance > braking and not (arrived and (slow_now or paused))
    walks = (WALKING and far) or ((still or STANDING or TURNING) and not arrived) or
            (not WALKING and distance > max(radius, braking) + resume_margin)
    if still and not walks:  stop_place = goal if distance > radius / 2 else hips
    else if WALKING and not walks:  stop_place = goal
    if not walks and (WALKING or still):  stop_facing = facing_of_hips
    mode = WALKING if walks, STANDING if (STANDING or still), else STOPPING
inputs
    goal          WALKING: the goal; else stop_place (z = 0)
    target_speed  WALKING: wished; else 0
    facing        WALKING: 0 0; else stop_facing
    term_weights  the row of the mode below;  policy  1;  noise  as above
after the step
    speed = |last hips - first hips of the step| on the floor / 0.2
    arrived = arrived or a frame of the step has its hips within radius of the goal
```

The "mode" on the
right is the one before the step. At the start a person stands: STANDING, speed 0, stop_place the
hips, stop_facing what they face.

The server does more, and none of it is in the graph: feet that bear weight are kept from sliding,
the speed is trimmed, half of all people are mirrored, people set off after a reaction time, and who
falls gets up. In Wayfarer's repository all of it is in `clients/cpp/local` (C++17, used by
`clients/cpp/examples/offline.cpp`) and `clients/web/src/local` (JavaScript): the frames are the
server's to 0.01 mm over 30 s.

## Modes
`term_weights` in the order {terms}.

| mode | term_weights | temperature | own |
|---|---|---|---|
{modes}

## Constants
| name | value | meaning |
|---|---|---|
{constants}

## Bodies
`body_<gender>.bin` holds these tensors one after another, float32, little-endian, C order.

| name | shape | byte offset | unit | meaning |
|---|---|---|---|---|
{parts}

**Joints**, each with its parent: {joints}.

**Markers**: {markers}. Soles: left {left}, right {right} (heel, two balls, toe).

## In engines
- **Unity** (Inference Engine, Sentis 2): put the .onnx into Assets, `ModelLoader.Load`, a `Worker`
  on `BackendType.CPU`, one `Tensor<float>` per input. Places (x, y, z) of this page are (x, z, y)
  in Unity, and quaternions (x, y, z, w) are (−x, −z, −y, w).
- **Unreal** (NNE): enable NNERuntimeORT, import the .onnx as `UNNEModelData`, `CreateModelCPU`,
  `SetInputTensorShapes`, `RunSync`. Places are 100 (y, x, z) in Unreal, which makes +X the front,
  and quaternions are (−y, −x, −z, w).
- **C, C++, C#, Rust**: ONNX Runtime 1.11 or newer; 1.15.0 and 1.32.0 were tried.

Operators: {operators}.
"""
