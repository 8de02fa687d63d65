"""A stream's poses on a character of any skeleton: clients/README.md, "Retargeting".

tests/golden/retarget.json holds the clients of all languages to it. Nothing here knows the axes of
the character's bones: its T-pose follows from the places of its joints.
"""

from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from .bases import BASES, Basis
from .bone_map import BoneMap
from .bones_by_name import SIDES
from .joints import LEGS, alignment, lowest_joint, middle, stands
from .quaternions import IDENTITY, Array, arc, inverse, multiply, rotate
from .rig import BONES, PARENTS
from .soles import Sole, Soles

REACH: Final = 0.999
"""Largest stretch of a leg, as a share of its length."""
SINKS: Final = 0.018
"""Most that hips sink for a standing foot to reach its print, as a share of the leg's length."""
STANDS: Final = 0.02
LEAVES: Final = 0.06
"""Heights of a sole over the ground, as shares of the leg's length: hips sink and a heel rises by
all that a foot lacks while it is below the first, by nothing when it is above the second.
"""
TIPTOE: Final = 0.25
"""Most that a heel rises for a foot to reach its print: radians about the ball."""
FLEX: Final = 0.5
"""Most that toes turn up where a shoe is longer than the agent's foot: radians."""
BEND: Final = 0.1
"""Share of the thigh's length; a knee that bends less than this bends forwards."""
ARMS: Final = tuple(
    tuple(BONES.index(f"{side}_{bone}") for bone in ("shoulder", "elbow", "wrist"))
    for side in SIDES
)


@dataclass(frozen=True)
class CharacterPose:
    """Turns of the mapped bones, in the character's space and by canonical bone number."""

    rotations: dict[int, Array] = field(repr=False)  # [4] in the world
    places: dict[int, Array] = field(repr=False)  # [3] in the world
    local: dict[int, Array] = field(repr=False)  # [4] relative to the node's parent
    moved: dict[int, Array] = field(repr=False)  # [3] relative to the parent: `Retarget.loose`
    ground: float = 0.0  # height of the ground below it

    @property
    def hips(self) -> Array:
        """[3] of the hips' node, relative to its parent."""
        return self.moved[0]


class Retarget:
    """Turns frames of an agent into poses of a character."""

    def __init__(
        self,
        bone_map: BoneMap,
        rest_offsets: Array,
        basis: Basis = BASES["gltf"],
        floor: float | None = None,
        soles: Soles | None = None,
    ) -> None:
        """`rest_offsets` [J, 3] of the agent; `floor`: height of the character's soles at rest;
        `soles`: found in its mesh (`measure_soles`).

        All in the stream's basis and unit, as is the character's own space.
        """
        self.basis = basis
        rig = bone_map.rig
        self.nodes = {BONES.index(bone): node for bone, node in bone_map.bones.items()}
        self.above = {b: _canonical(b, self.nodes) for b in self.nodes}
        """The bone that each one follows, if the character has it."""
        self.hangs = {b: _nearest(rig.ancestors(n), self.nodes) for b, n in self.nodes.items()}
        """The bone that each one's node hangs from in the file; -1: none."""
        self.loose = tuple(b for b in self.nodes if b == 0 or self.hangs[b] != self.above[b])
        """Bones whose places must be set, too: the hips, and bones that hang from another bone
        than they follow.
        """
        self._source(np.asarray(rest_offsets, float)[: len(BONES)])
        self.turn = turn = alignment(bone_map, basis)
        """The rotation [4] from the character's axes to the basis."""
        rest = {b: multiply(turn, rig.rotations[n]) for b, n in self.nodes.items()}
        place = {b: rotate(turn, rig.places[n]) for b, n in self.nodes.items()}
        correct = self._corrections(place)
        self.rest = {b: multiply(correct[b], rest[b]) for b in self.nodes}
        """World rotation of each bone [4] in the T-pose."""
        self._offset = {}  # of each bone, in the axes of the one above
        self._parent: dict[int, tuple[Array, Array, Array]] = {}
        """Rotation, place and scale of each node's parent, in the axes of the bone it hangs
        from.
        """
        for b, node in self.nodes.items():
            if b:
                a = self.above[b]
                self._offset[b] = rotate(inverse(rest[a]), place[b] - place[a])
            parent, a = rig.nodes[node].parent, self.hangs[b]
            if parent < 0:
                self._parent[b] = (IDENTITY, np.zeros(3), np.ones(3))
                continue
            turned, at = rig.rotations[parent], rig.places[parent]
            if a >= 0:
                back = inverse(rig.rotations[self.nodes[a]])
                turned = multiply(back, turned)
                at = rotate(back, at - rig.places[self.nodes[a]])
            self._parent[b] = (turned, at, rig.scales[parent])
        self._thighs = rotate(inverse(rest[0]), middle(place) - place[0])  # in the hips' axes
        self._legs(place, correct, floor, soles)

    def _source(self, offsets: Array) -> None:
        self.offsets = offsets
        self.source_rest = np.zeros_like(offsets)
        for b, parent in enumerate(PARENTS):
            above = self.source_rest[parent] if parent >= 0 else 0
            self.source_rest[b] = above + offsets[b]

    def _corrections(self, place: dict[int, Array]) -> dict[int, Array]:
        """What turns each bone from the character's rest pose into a T-pose."""
        basis = self.basis
        aims: dict[int, tuple[int, Array]] = {}
        for side, (hip, knee, ankle, _) in zip((1, -1), LEGS, strict=True):
            aims |= {hip: (knee, -basis.up), knee: (ankle, -basis.up)}
            shoulder, elbow, wrist = ARMS[0 if side > 0 else 1]
            aims |= {shoulder: (elbow, side * basis.left), elbow: (wrist, side * basis.left)}
        correct: dict[int, Array] = {}
        for b in self.nodes:
            turn = correct.get(self.above[b], IDENTITY)
            if b in aims and aims[b][0] in place:
                end, aim = aims[b]
                turn = multiply(arc(rotate(turn, place[end] - place[b]), aim), turn)
            correct[b] = turn
        for *_, ankle, toe in LEGS:  # soles stay level: feet only turn to the front
            ahead = basis.level(place[toe] - place[ankle]) if toe in place else basis.forward
            correct[ankle] = arc(ahead, basis.forward)
            if toe in place:
                correct[toe] = correct[ankle]
        return correct

    def _legs(
        self,
        place: dict[int, Array],
        correct: dict[int, Array],
        floor: float | None,
        soles: Soles | None,
    ) -> None:
        up = self.basis.up
        stand = {0: place[0]}  # joint places in the T-pose
        for b in self.nodes:
            if b:
                a = self.above[b]
                stand[b] = stand[a] + rotate(correct[a], place[b] - place[a])
        source = self.source_rest
        legs = sum((stand[leg[0]] - stand[leg[2]]) @ up for leg in LEGS)
        scale = legs / sum((source[leg[0]] - source[leg[2]]) @ up for leg in LEGS)
        thighs, source_thighs = middle(stand), middle(source)
        if floor is None and soles is not None:
            floor = soles.floor
        if floor is None and not stands(place, up):
            sole = min(source[b] @ up for leg in LEGS for b in leg[2:])
            floor = lowest_joint(place, up) - scale * sole
        floor = floor or 0.0
        self.length = [
            float(sum(np.linalg.norm(self._offset[b]) for b in bones[1:3])) for bones in LEGS
        ]
        """Length of each leg, from thigh joint to ankle along its bones."""
        self.foot, self.source_foot, self.stance, high = [], [], [], 0.0
        self.tip = []
        """Farthest and lowest reach of each foot's toes [3], from their joint."""
        for k, (_, _, ankle, toe) in enumerate(LEGS):
            ball = source[toe] - source[ankle]
            self.source_foot.append(Sole.of_joints(ball, source[ankle] @ up, self.basis))
            own = scale * ball  # where a foot of this size would have it
            if toe in place:
                own = rotate(correct[ankle], place[toe] - place[ankle])
            height = float(place[ankle] @ up) - floor
            high += height / len(LEGS)
            foot = Sole.of_joints(own, height, self.basis)
            if soles is not None:
                fixed, toes = (
                    np.array([rotate(correct[ankle], point) for point in part]).reshape(-1, 3)
                    for part in soles.feet[k]
                )
                if toe not in place:
                    toes = np.zeros((0, 3))
                foot = replace(foot, joint=own, fixed=fixed, toes=toes)
            self.foot.append(foot)
            tip = np.zeros(3)
            if len(foot.toes):
                forward = self.basis.forward
                tip = (foot.toes @ forward).max() * forward + (foot.toes @ up).min() * up
            self.tip.append(tip)
            beside = (stand[ankle] + own - thighs - (source[toe] - source_thighs)) @ self.basis.left
            self.stance.append(beside * self.basis.left)
        self.ratio = float((legs / len(LEGS) + high) / (source_thighs @ up))
        """Height of the character's thigh joints by that of the agent's."""
        self.floor = floor
        """Height of the character's soles at rest."""
        self.origin = self.basis.level(middle(place)) + floor * up
        """The point of the ground below the character at rest [3], upright in the basis."""

    def pose(self, hips: Array, rotations: Array, ground: float | None = None) -> CharacterPose:
        """A frame of the stream (hips [3], local rotations [22, 4]) on the character.

        `ground`: height of the ground there; none: that of the lower sole.
        """
        basis, up = self.basis, self.basis.up
        turns, places = self._source_pose(np.asarray(hips, float), np.asarray(rotations, float))
        lows = [
            sole.lowest(turns[ankle], turns[toe], up)
            for (_, _, ankle, toe), sole in zip(LEGS, self.source_foot, strict=True)
        ]
        clear = [float(places[bones[2]] @ up) + low for bones, low in zip(LEGS, lows, strict=True)]
        if ground is None:
            ground = min(clear)
        for leg, (*_, ankle, toe) in enumerate(LEGS):
            if toe in self.nodes:
                turns[toe] = self._flexed(leg, lows[leg], turns[ankle], turns[toe])
        world: dict[int, Array] = {b: multiply(turns[b], self.rest[b]) for b in self.nodes}
        thighs = middle(places)
        lifted = ground + (thighs @ up - ground) * self.ratio
        thighs = basis.level(thighs) + lifted * up
        found: dict[int, Array] = {0: thighs - rotate(world[0], self._thighs)}
        self._put(world, found)
        high = [max(0.0, height - ground) * self.ratio for height in clear]
        goals = [self._goal(leg, turns, places, ground + high[leg]) for leg in range(len(LEGS))]
        stays = [
            min(1.0, max(0.0, (LEAVES - above / length) / (LEAVES - STANDS)))
            for above, length in zip(high, self.length, strict=True)
        ]
        most = [self._reach(leg, goals[leg], places, found) for leg in range(len(LEGS))]
        sunk = max(
            self._lacks(leg, goals[leg], most[leg], stays[leg], found) for leg in range(len(LEGS))
        )
        for b in found:
            found[b] = found[b] - sunk * up
        for leg, bones in enumerate(LEGS):
            goal = self._raised(leg, goals[leg], most[leg], stays[leg], turns, world, found)
            self._bend(bones, goal, most[leg], turns, world, found)
        self._put(world, found)
        return CharacterPose(world, found, *self._local(world, found), ground)

    def _source_pose(self, hips: Array, rotations: Array) -> tuple[list[Array], list[Array]]:
        turns: list[Array] = []
        places: list[Array] = []
        for b, parent in enumerate(PARENTS):
            own = rotations[b] / np.linalg.norm(rotations[b])
            if parent < 0:
                turns.append(own)
                places.append(hips)
            else:
                turns.append(multiply(turns[parent], own))
                places.append(places[parent] + rotate(turns[parent], self.offsets[b]))
        return turns, places

    def _put(self, world: dict[int, Array], places: dict[int, Array]) -> None:
        for b in self.nodes:
            if b:
                a = self.above[b]
                places[b] = places[a] + rotate(world[a], self._offset[b])

    def _goal(self, leg: int, turns: list[Array], source: list[Array], high: float) -> Array:
        """Where the ankle goes [3]: ball over the same point as the agent's, sole at a height."""
        basis, up = self.basis, self.basis.up
        _, _, ankle, toe = LEGS[leg]
        sole = self.foot[leg]
        ahead = basis.level(rotate(turns[ankle], basis.forward))
        if np.linalg.norm(ahead) < 0.1:  # it points straight down
            ahead = basis.level(rotate(turns[0], basis.forward))
        low, ball = sole.lowest(turns[ankle], turns[toe], up), rotate(turns[ankle], sole.ball)
        print_at = source[ankle] + rotate(turns[ankle], self.source_foot[leg].ball)
        beside = rotate(arc(basis.forward, ahead), self.stance[leg])
        return np.asarray(basis.level(print_at + beside - ball) + (high - low) * up)

    def _flexed(self, leg: int, low: float, ankle: Array, toe: Array) -> Array:
        """The turn [4] of toes that a long shoe bends up, so that the ankle is as high over where
        it stands as the agent's, scaled; `low`: the agent's lowest point from its ankle.
        """
        basis, up, sole = self.basis, self.basis.up, self.foot[leg]
        axis = -basis.level(rotate(ankle, basis.left)) * basis.handed
        wide = float(np.linalg.norm(axis))
        if not len(sole.toes) or wide < 0.1:
            return toe
        axis /= wide
        stands = float((self.ratio * self.source_foot[leg].ball - sole.ball) @ up)
        deep = min(0.0, self.ratio * low - stands - float(rotate(ankle, sole.joint) @ up))
        tip = rotate(toe, self.tip[leg])
        high, rises = float(tip @ up), float(np.cross(axis, tip) @ up)
        share = deep / max(float(np.hypot(high, rises)), 1e-9)
        angle = float(np.arcsin(max(-1.0, share)) - np.arctan2(high, rises))
        angle = min(FLEX, max(0.0, angle))
        return multiply(np.array([*(np.sin(angle / 2) * axis), np.cos(angle / 2)]), toe)

    def _reach(self, leg: int, goal: Array, source: list[Array], places: dict[int, Array]) -> float:
        """How far an ankle may be from its thigh joint: as straight as the agent's leg is, and
        from there smoothly less of what the goal asks for.
        """
        hip, knee, ankle, _ = LEGS[leg]
        parts = np.linalg.norm(self.offsets[knee]) + np.linalg.norm(self.offsets[ankle])
        own = float(np.linalg.norm(source[ankle] - source[hip]) / parts)
        over = float(np.linalg.norm(goal - places[hip])) / self.length[leg] - own
        room = max(REACH - own, 1e-6)
        soft = own + room * (1 - np.exp(-max(0.0, over) / room))
        return float(min(REACH, soft) * self.length[leg])

    def _lacks(
        self, leg: int, goal: Array, most: float, stays: float, places: dict[int, Array]
    ) -> float:
        """How far the hips must sink for a foot to reach its print; `stays`: 1 for a foot on the
        ground, 0 for a foot off it.
        """
        start, length = places[LEGS[leg][0]], self.length[leg]
        away = float(np.linalg.norm(self.basis.level(goal - start)))
        lacks = float((start - goal) @ self.basis.up) - np.sqrt(max(0.0, most**2 - away**2))
        return float(min(SINKS * length, max(0.0, lacks) * stays))

    def _raised(
        self,
        leg: int,
        goal: Array,
        most: float,
        stays: float,
        turns: list[Array],
        world: dict[int, Array],
        places: dict[int, Array],
    ) -> Array:
        """The goal of an ankle [3] with the heel up so far that the leg reaches it: the foot turns
        about its ball, as far as the ball bears it.
        """
        hip, _, ankle, _ = LEGS[leg]
        start = places[hip]
        basis, up, foot = self.basis, self.basis.up, turns[ankle]
        sole = self.foot[leg]
        heel, ball = rotate(foot, sole.heel), rotate(foot, sole.ball)
        axis = basis.level(rotate(foot, basis.left))
        axis = axis / np.linalg.norm(axis)
        raises = np.cross(ball, axis)  # which way the ankle goes
        if raises @ up < 0:
            axis, raises = -axis, -raises
        thigh = start - goal - ball  # from the ball
        aside = (axis @ ball) * axis
        near, ahead = float(thigh @ (aside - ball)), float(thigh @ raises)
        wanted = float(thigh @ thigh + ball @ ball - most**2) / 2 + float(thigh @ aside)
        share = wanted / max(float(np.hypot(near, ahead)), 1e-9)
        lacking = float(np.arctan2(ahead, near) - np.arccos(min(1.0, max(-1.0, share))))
        bears = min(1.0, max(0.0, 1 - float((ball - heel) @ up) / (STANDS * self.length[leg])))
        angle = stays * bears * min(TIPTOE, max(0.0, lacking))
        turn = np.array([*(np.sin(angle / 2) * axis), np.cos(angle / 2)])
        world[ankle] = multiply(turn, world[ankle])
        return np.asarray(goal + ball - rotate(turn, ball))

    def _bend(
        self,
        bones: tuple[int, ...],
        goal: Array,
        most: float,
        turns: list[Array],
        world: dict[int, Array],
        places: dict[int, Array],
    ) -> None:
        """Turn thigh and shin so that the ankle is at the goal, or as near as the leg reaches."""
        hip, knee, ankle, _ = bones
        basis = self.basis
        start, bend, end = places[hip], places[knee], places[ankle]
        thigh = float(np.linalg.norm(bend - start))
        shin = float(np.linalg.norm(end - bend))
        goal = self._within(start, goal, most, 1.001 * abs(thigh - shin))
        far = float(np.linalg.norm(goal - start))
        along = (goal - start) / far
        side = (bend - start) - ((bend - start) @ along) * along
        front = rotate(turns[hip], basis.forward)
        front = front - (front @ along) * along
        front = front / max(float(np.linalg.norm(front)), 1e-6)
        side = side + max(0.0, BEND * thigh - float(side @ front)) * front
        side /= max(float(np.linalg.norm(side)), 1e-9)
        reach = (thigh**2 + far**2 - shin**2) / (2 * far)
        knee_at = start + reach * along + np.sqrt(max(0.0, thigh**2 - reach**2)) * side
        world[hip] = multiply(arc(bend - start, knee_at - start), world[hip])
        world[knee] = multiply(arc(end - bend, goal - knee_at), world[knee])

    def _within(self, start: Array, goal: Array, most: float, least: float) -> Array:
        """A place that the leg reaches: at the goal's height, if it can, nearer to the hip."""
        up = self.basis.up
        down = float((goal - start) @ up)
        away = self.basis.level(goal - start)
        wide = float(np.linalg.norm(away))
        if np.hypot(down, wide) > most:
            down = max(-most, min(most, down))
            away = away * (np.sqrt(most**2 - down**2) / max(wide, 1e-9))
        elif np.hypot(down, wide) < least:
            return np.asarray(start - least * up)
        return np.asarray(start + away + down * up)

    def _local(
        self, world: dict[int, Array], places: dict[int, Array]
    ) -> tuple[dict[int, Array], dict[int, Array]]:
        """Rotations [4] and, of loose bones, places [3], relative to the nodes' parents."""
        local: dict[int, Array] = {}
        moved: dict[int, Array] = {}
        for b in self.nodes:
            turn, at, scale = self._parent[b]
            a = self.hangs[b]
            if a >= 0:
                turn = multiply(world[a], turn)
                at = places[a] + rotate(world[a], at)
            local[b] = multiply(inverse(turn), world[b])
            if b in self.loose:
                moved[b] = rotate(inverse(turn), places[b] - at) / scale
        return local, moved


def _canonical(bone: int, nodes: dict[int, int]) -> int:
    """The nearest existing bone above; -1: none."""
    while (bone := PARENTS[bone]) >= 0:
        if bone in nodes:
            return bone
    return -1


def _nearest(ancestors: list[int], nodes: dict[int, int]) -> int:
    """The bone of the first ancestor that is one; -1: none."""
    bones = {node: bone for bone, node in nodes.items()}
    return next((bones[node] for node in ancestors if node in bones), -1)
