"""How well characters with other skeletons follow an agent, as figures.

    python -m tests.clients.rig_errors [--walk CLIP.npz] [CHARACTER.glb ...]

prints a row for each rig of tests/golden (made here and by others), or for each named GLB or VRM
file. The walk is tests/golden/walk.json, or an npz file of `wayfarer generate`.
The figures come from joint places and rotations, with the soles that retargeting assumes; the
viewer's tests measure the skin (tests/viewer/watch_character.js).
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.golden.rigs import cases, foreign_rigs
from wayfarer_client.bone_map import BoneMap, map_bones
from wayfarer_client.character import Character
from wayfarer_client.joints import LEGS
from wayfarer_client.quaternions import inverse, multiply, rotate
from wayfarer_client.retarget import Retarget
from wayfarer_client.rig import BONES, PARENTS
from wayfarer_client.soles import Sole

Array = np.ndarray
LIMBS = ((1, 4), (4, 7), (2, 5), (5, 8), (16, 18), (18, 20), (17, 19), (19, 21))
"""Both ends of thighs, shins, upper arms and forearms."""


@dataclass(frozen=True)
class Walk:
    """Motion of an agent in the glTF basis."""

    rest_offsets: Array  # [22, 3]
    hips: Array  # [N, 3]
    rotations: Array  # [N, 22, 4]
    contacts: Array  # [N, 2]

    @classmethod
    def golden(cls) -> "Walk":
        """The walk of the golden traces: 3 s at 20 frames a second."""
        data = json.loads((Path(__file__).parents[1] / "golden" / "walk.json").read_text())
        bits = np.array(data["contacts"])
        return cls(
            np.array(data["rest_offsets"]).reshape(-1, 3),
            np.array(data["hips"]),
            np.array(data["rotations"]).reshape(len(bits), -1, 4),
            np.stack([bits & 1, bits & 2], 1) > 0,
        )

    @classmethod
    def of_clip(cls, path: Path) -> "Walk":
        """A clip of `wayfarer generate`."""
        from tests.wire_poses import quaternions_to_wire
        from wayfarer.body.library import load_body
        from wayfarer.clips.npz import read_npz
        from wayfarer.transport.conversion.basis import Basis

        clip, axes = read_npz(path), Basis.GLTF.axes
        body = load_body(clip.body, clip.gender)
        offsets = body.rest_joints(np.array(clip.betas))
        offsets[1:] -= offsets[body.parents[1:]]
        return cls(
            np.asarray(axes.points_to_wire(offsets))[: len(BONES)],
            np.asarray(axes.points_to_wire(clip.translation)),
            np.asarray(quaternions_to_wire(axes, clip.rotations)),
            np.asarray(clip.contacts),
        )

    def places(self, frame: int) -> tuple[Array, list[Array]]:
        """Joints of the agent in the world [22, 3], and rotations there."""
        places, turns = [self.hips[frame]], [self.rotations[frame, 0]]
        for bone in range(1, len(BONES)):
            above = PARENTS[bone]
            places.append(places[above] + rotate(turns[above], self.rest_offsets[bone]))
            turns.append(multiply(turns[above], self.rotations[frame, bone]))
        return np.array(places), turns


@dataclass(frozen=True)
class Errors:
    """Extremes over a walk on level ground."""

    foot_height: float
    """Difference of a standing foot's lowest point from the agent's scaled height, metres."""
    slide: float
    """Movement of a standing foot's ball from where it began to stand, beyond the agent's own,
    metres."""
    hips: float
    """Difference of the thigh joints' middle from the agent's scaled height, as a share."""
    arms: float
    legs: float
    """Degrees between the directions of a limb and the agent's. Legs bend to reach the print."""
    upright: float
    """Cosine of the trunk's direction (hips to head, or chest) and the agent's: shows flips."""


def errors(retarget: Retarget, walk: Walk) -> Errors:
    """Errors of a character in the glTF basis."""
    feet, slides, hips, upright = [0.0], [0.0], [0.0], [1.0]
    arms, legs = [0.0], [0.0]
    began: dict[int, Array] = {}
    for frame in range(len(walk.hips)):
        places, turns = walk.places(frame)
        pose = retarget.pose(walk.hips[frame], walk.rotations[frame], ground=0.0)
        found = pose.places
        for leg, (_, _, ankle, toe) in enumerate(LEGS):
            if not walk.contacts[frame, leg]:
                began.pop(leg, None)
                continue
            turned = multiply(pose.rotations[ankle], inverse(retarget.rest[ankle]))
            bent = turns[toe]
            if toe in pose.rotations:
                bent = multiply(pose.rotations[toe], inverse(retarget.rest[toe]))
            low, ball = _sole(retarget.foot[leg], turned, bent)
            own_low, own_ball = _sole(retarget.source_foot[leg], turns[ankle], turns[toe])
            own_height = retarget.ratio * max(0.0, places[ankle][1] + own_low)
            feet.append(abs(found[ankle][1] + low - own_height))
            moved = (found[ankle] + ball - places[ankle] - own_ball)[[0, 2]]
            slides.append(float(np.linalg.norm(moved - began.setdefault(leg, moved))))
        middle, wanted = (sum(at[leg[0]][1] for leg in LEGS) / 2 for at in (found, places))
        hips.append(abs(middle / (retarget.ratio * wanted) - 1))
        for k, (above, below) in enumerate(LIMBS):
            if above in found and below in found:
                angle = _angle(found[below] - found[above], places[below] - places[above])
                (legs if k < 4 else arms).append(angle)
        top = next(bone for bone in (15, 12, 9, 6, 3, 0) if bone in found)
        if top:
            trunk = _angle(found[top] - found[0], places[top] - places[0])
            upright.append(float(np.cos(np.radians(trunk))))
    return Errors(max(feet), max(slides), max(hips), max(arms), max(legs), min(upright))


def _sole(foot: Sole, ankle: Array, toe: Array) -> tuple[float, Array]:
    """Height of the lowest point of a foot over its ankle, and the ball relative to the ankle, for
    turns of ankle and toes.
    """
    points = [rotate(ankle, point) for point in foot.fixed]
    points += [rotate(ankle, foot.joint) + rotate(toe, point) for point in foot.toes]
    return min(point[1] for point in points), rotate(ankle, foot.ball)


def _angle(a: Array, b: Array) -> float:
    """Degrees between two directions."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def rigs(files: Sequence[Path] = ()) -> dict[str, BoneMap]:
    """The rigs of the files, or of tests/golden."""
    if files:
        return {file.stem: Character.read(file).bones for file in files}
    made = {case.name: map_bones(case.rig, case.humanoid) for case in cases() if case.gltf}
    return made | {f"foreign {name}": map_bones(rig) for name, rig in foreign_rigs().items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--walk", type=Path, help="npz of `wayfarer generate`")
    parser.add_argument("characters", type=Path, nargs="*", help="GLB or VRM files")
    given = parser.parse_args()
    walk = Walk.of_clip(given.walk) if given.walk else Walk.golden()
    lines = ["| rig | ratio | foot height cm | slide cm | hips % | arms ° | legs ° | upright |"]
    lines.append("|---|---|---|---|---|---|---|---|")
    for name, bone_map in rigs(given.characters).items():
        retarget = Retarget(bone_map, walk.rest_offsets)
        found = errors(retarget, walk)
        row = (
            *(
                f"{retarget.ratio:.3f}",
                f"{100 * found.foot_height:.2f}",
                f"{100 * found.slide:.2f}",
            ),
            *(f"{100 * found.hips:.2f}", f"{found.arms:.1f}", f"{found.legs:.1f}"),
            f"{found.upright:.3f}",
        )
        lines.append(f"| {name} | {' | '.join(row)} |")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
