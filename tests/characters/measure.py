"""Figures of a GLB with one animation, as a player shows it: joints, skin and soles.

    python -m tests.characters.measure [--seconds 8] [--live] [CHARACTER.glb ...]

puts the motion of `wayfarer generate --goal 3,2` on each file (default: all of
tests/characters/cases) and prints a row for each, or the refusal. With --live, a person
walks straight ahead on characters of many sizes, not scaled, as in a live session.
"""

import argparse
import contextlib
import io
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import astuple, dataclass, fields
from functools import cache, partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from tests.characters.made import person
from tests.played import Played
from wayfarer.characters.character import Character
from wayfarer.clips import generate as command
from wayfarer.clips.clip import Clip
from wayfarer.clips.files import FileOptions
from wayfarer.clips.on_character import body_of, on_character
from wayfarer.errors import WayfarerError
from wayfarer.models.bundle import open_bundle
from wayfarer.spec import BETAS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering

CASES = Path(__file__).with_name("cases")
NEAR = 0.01
"""Metres within which skin touches the ground, for a person's size."""
PERSON = 0.85
"""Metres from a person's thigh joints to the ankles: lengths are scaled with it."""
SIZES = (0.62, 0.66, 0.75, 0.93, 1.0, 1.5, 2.1, 5.0)
"""Sizes of the characters of a live session: 1 to 8 m."""

Array = np.ndarray


class PlayedCharacter(Played):
    """A character at each frame of its first animation."""

    def __init__(self, data: bytes) -> None:
        character = Character.read(data)
        super().__init__(character.document, character.binary)
        self.bones = {bone: character.numbers[node] for bone, node in character.bones.bones.items()}

    def place(self, bone: str) -> Array:
        """[F, 3] of a joint."""
        return self.world[self.bones[bone]][:, :3, 3]

    def skins(self) -> Iterator[tuple[Array, Array, Array, Array, Array]]:
        """Yields for each skinned primitive: posed vertices [F, V, 3], bound ones [V, 3], nodes
        [V, 4], weights [V, 4] and edges [E, 2].
        """
        for node in self.document["nodes"]:
            if "mesh" not in node or "skin" not in node:
                continue
            skin = self.document["skins"][node["skin"]]
            joints = np.array(skin["joints"])
            bind = self.values(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
            moves = np.stack([self.world[k] for k in joints], 1) @ bind
            for primitive in self.document["meshes"][node["mesh"]]["primitives"]:
                attributes = primitive["attributes"]
                bound = self.values(attributes["POSITION"])
                which = self.values(attributes["JOINTS_0"])
                weights = self.values(attributes["WEIGHTS_0"]).astype(float)
                weights /= weights.sum(1, keepdims=True)  # bytes count as shares of 255
                upright = np.pad(bound, ((0, 0), (0, 1)), constant_values=1.0)
                posed = np.zeros((self.frames, len(bound), 3))
                for k in range(4):
                    moved = np.einsum("fvij,vj->fvi", moves[:, which[:, k]], upright)[..., :3]
                    posed += weights[None, :, k, None] * moved
                faces = self.values(primitive["indices"]).reshape(-1, 3)
                edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
                yield posed, bound, joints[which], weights, edges

    def below(self, node: int) -> set[int]:
        """The node and all that hang from it."""
        found = [node]
        for k in found:
            found += self.document["nodes"][k].get("children", [])
        return set(found)


@dataclass(frozen=True)
class Figures:
    """Extremes over the frames of a file."""

    turn: float
    """Maximum degrees that a joint turns from a frame to the next."""
    lowest: float
    """Minimum height of the skin's lowest point in centimetres, at a person's size."""
    slide: float
    """Maximum centimetres that a standing foot slides, at a person's size."""
    stretch: float
    """Maximum length of an edge of the skin, relative to its length at rest."""
    backward: float
    """Share of frames in which a knee is bent backwards by more than 5 degrees."""
    facing: float
    """Mean cosine between the way of the hips and where the toes point, while it walks."""
    lean: float
    """Degrees of the trunk off upright: median."""
    knee: float
    """Degrees of the knees' bend: median."""
    left_behind: float
    """Maximum metres by which a mesh's centre is farther from the hips than at rest."""


def figures(data: bytes, contacts: Array) -> Figures:
    """Measures a file with motion; `contacts` [F, 2] are the person's standing feet."""
    played = PlayedCharacter(data)
    turns = [v for (_, path), v in played.channels.items() if path == "rotation" and len(v) > 1]
    turn = max(float(_angles(v).max()) for v in turns)
    feet = {side: _foot_nodes(played, side) for side in ("left", "right")}
    leg = [played.place(f"left_{bone}")[0] for bone in ("hip", "knee", "ankle")]
    size = float(np.linalg.norm(np.diff(leg, axis=0), axis=1).sum()) / PERSON
    lowest, stretch, behind, slide = np.inf, 0.0, 0.0, 0.0
    soles: dict[str, list[Array]] = {side: [] for side in feet}
    for posed, bound, which, weights, edges in played.skins():
        lowest = min(lowest, float(posed[..., 1].min()))
        rests = np.linalg.norm(bound[edges[:, 0]] - bound[edges[:, 1]], axis=-1)
        shown = np.linalg.norm(posed[:, edges[:, 0]] - posed[:, edges[:, 1]], axis=-1)
        longer = shown / np.maximum(rests, 1e-6)
        stretch = max(stretch, float(longer.max() / np.median(longer)))
        most = which[np.arange(len(which)), weights.argmax(1)]
        for side, nodes in feet.items():
            soles[side].append(posed[:, np.isin(most, list(nodes))])
    stands = contacts[np.linspace(0, len(contacts) - 1, played.frames).round().astype(int)]
    for k, side in enumerate(feet):
        slide = max(slide, _slide(np.concatenate(soles[side], 1), stands[:, k], size))
    for number, node in enumerate(played.document["nodes"]):
        if "mesh" in node and "skin" not in node and number in played.world:
            away = np.linalg.norm(played.world[number][:, :3, 3] - played.place("pelvis"), axis=1)
            behind = max(behind, float((away - away[0]).max()))
    return Figures(
        turn=turn,
        lowest=100 * lowest / size,
        slide=slide,
        stretch=stretch,
        backward=_backward(played),
        facing=_facing(played),
        lean=_lean(played),
        knee=_knee(played),
        left_behind=behind,
    )


def _angles(turns: Array) -> Array:
    dots = np.abs((turns[1:] * turns[:-1]).sum(-1)) / (
        np.linalg.norm(turns[1:], axis=-1) * np.linalg.norm(turns[:-1], axis=-1)
    )
    return np.degrees(2 * np.arccos(np.minimum(1.0, dots)))


def _foot_nodes(played: PlayedCharacter, side: str) -> set[int]:
    return played.below(played.bones[f"{side}_ankle"])


def _slide(foot: Array, stands: Array, size: float) -> float:
    """Centimetres of the longest slide of a standing foot with this skin [F, V, 3]: from frame to
    frame, the least movement of a point on the ground.
    """
    if not foot.shape[1]:
        return 0.0
    low = foot[..., 1].min(1)
    most = total = 0.0
    for frame in range(1, len(foot)):
        if not (stands[frame] and stands[frame - 1]):
            total = 0.0
            continue
        touches = foot[frame, :, 1] < low[frame] + NEAR * size
        moved = foot[frame, touches][:, [0, 2]] - foot[frame - 1, touches][:, [0, 2]]
        total += float(np.linalg.norm(moved, axis=1).min())
        most = max(most, total)
    return 100 * most / size


def _backward(played: PlayedCharacter) -> float:
    bent = np.zeros(played.frames, bool)
    for side in ("left", "right"):
        hip, knee, ankle = (played.place(f"{side}_{bone}") for bone in ("hip", "knee", "ankle"))
        ahead = _ahead(played)
        thigh, shin = _unit(knee - hip), _unit(ankle - knee)
        along = _unit(ankle - hip)
        off = (knee - hip) - ((knee - hip) * along).sum(1)[:, None] * along
        bend = np.degrees(np.arccos(np.clip((thigh * shin).sum(1), -1, 1)))
        bent |= ((off * ahead).sum(1) < 0) & (bend > 5)
    return float(bent.mean())


def _ahead(played: PlayedCharacter) -> Array:
    """[F, 3] where the character faces, by its thigh joints."""
    left = played.place("left_hip") - played.place("right_hip")
    ahead = np.cross(left, [0, 1.0, 0])
    return _unit(ahead)


def _facing(played: PlayedCharacter) -> float:
    """The cosine, by the toes of the foot that stands, or by the thigh joints without toes.

    A foot that swings in high heels hangs past the vertical, and its toes point back.
    """
    hips = played.place("pelvis")
    way = (hips[20:] - hips[:-20])[:, [0, 2]]
    fast = np.linalg.norm(way, axis=1)
    ahead = _ahead(played)
    if {"left_foot", "right_foot"} <= set(played.bones):
        ankles = np.stack([played.place(f"{side}_ankle") for side in ("left", "right")])
        toes = np.stack([played.place(f"{side}_foot") for side in ("left", "right")])
        stands = ankles[..., 1].argmin(0)
        ahead = (toes - ankles)[stands, np.arange(len(stands))]
    ahead = _unit(ahead[10:-10][:, [0, 2]])
    moving = fast > 0.5 * fast.max()
    return float(((way / np.maximum(fast, 1e-9)[:, None]) * ahead).sum(1)[moving].mean())


def _lean(played: PlayedCharacter) -> float:
    top = next((b for b in ("head", "neck", "spine3") if b in played.bones), None)
    if top is None:
        return 0.0
    trunk = _unit(played.place(top) - played.place("pelvis"))
    return float(np.median(np.degrees(np.arccos(np.clip(trunk[:, 1], -1, 1)))))


def _knee(played: PlayedCharacter) -> float:
    bends = []
    for side in ("left", "right"):
        hip, knee, ankle = (played.place(f"{side}_{bone}") for bone in ("hip", "knee", "ankle"))
        cosine = (_unit(knee - hip) * _unit(ankle - knee)).sum(1)
        bends.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return float(np.median(bends))


def _unit(rows: Array) -> Array:
    return rows / np.maximum(np.linalg.norm(rows, axis=-1, keepdims=True), 1e-9)


cached_bundle = cache(open_bundle)


def walked(
    file: Path, seconds: float = 8.0, goals: tuple[str, ...] = ("3,2",)
) -> tuple[bytes, Array]:
    """The output of `wayfarer generate out.glb --character FILE --goal 3,2`, and the person's
    standing feet [F, 2]. Raises WayfarerError.
    """
    clips = []

    def kept(clip: Clip, *rest: Any) -> bytes:
        clips.append(clip)
        return on_character(clip, *rest)

    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(command, "open_bundle", cached_bundle),
        patch.object(command, "on_character", kept),
        contextlib.redirect_stdout(io.StringIO()),
    ):
        target = Path(folder) / "out.glb"
        command.generate(target, goal=list(goals), seconds=seconds, character=file)
        return target.read_bytes(), np.asarray(clips[0].contacts)


@cache
def straight(metres: float, seconds: float) -> Clip:
    """The mean woman walks straight ahead to a goal."""
    bundle = cached_bundle(command.DEFAULT_MODEL, 1)
    world = bundle.world(1, Steering())
    spec = AgentSpec(gender="female", betas=(0.0,) * BETAS)
    goals = [Goal((0.0, metres, 0.0), speed=command.SPEED)]
    return command.generate_clip(world, spec, goals, seconds)


def recorded() -> Clip:
    """A stride of that walk, the same for all characters."""
    return straight(9.0, 3.0)[60:]


def retargeted(data: bytes) -> tuple[bytes, Array]:
    """The recorded stride on a character, scaled as `generate --character` scales it, and which
    feet stand [F, 2]. Raises WayfarerError.
    """
    character, clip = Character.read(data), recorded()
    scale = body_of(character).scale
    return on_character(clip, character, FileOptions(), "walk", scale), np.asarray(clip.contacts)


def live(size: float) -> Figures:
    """Figures of a mean woman of this size with the motion of size 1, not scaled."""
    clip = straight(14.0, 5.0)[60:]
    data = on_character(clip, Character.read(person(size).data()), FileOptions(), "walk")
    return figures(data, np.asarray(clip.contacts))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--live", action="store_true")
    parser.add_argument("files", type=Path, nargs="*")
    given = parser.parse_args()
    names = [column.name for column in fields(Figures)]
    sys.stdout.write(f"| file | {' | '.join(names)} |\n|{'---|' * (len(names) + 1)}\n")
    made: dict[str, Callable[[], Figures]] = {
        file.stem: partial(lambda file: figures(*walked(file, given.seconds)), file)
        for file in given.files or sorted(CASES.glob("*.glb"))
    }
    if given.live:
        made = {f"size {size}": partial(live, size) for size in SIZES}
    for name, measured in made.items():
        try:
            row = " | ".join(f"{cell:.2f}" for cell in astuple(measured()))
        except WayfarerError as refusal:
            row = f"refused: {refusal}"
        sys.stdout.write(f"| {name} | {row} |\n")


if __name__ == "__main__":
    main()
