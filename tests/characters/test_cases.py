"""Other people's characters, animated by `wayfarer generate --character`: cases and siblings."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tests.characters.made import MIXAMO, Made, Shoe, lifted, moved, number, of, person
from tests.characters.measure import (
    CASES,
    Figures,
    PlayedCharacter,
    figures,
    recorded,
    retargeted,
    straight,
    walked,
)
from tests.clips.test_gltf_validator import issues
from tests.clips.test_gltf_validator import pytestmark as needs_validator
from tests.golden.rigs import (
    Body,
    animal,
    offsets_of,
    scaled,
    skirted,
    strange,
    turned,
)
from wayfarer.body.proportions import fit_betas
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.characters.character import Character
from wayfarer.characters.skins import Skins
from wayfarer.errors import InvalidArgument
from wayfarer_client.quaternions import multiply

TURN = 15.0
"""Degrees that a joint may turn within a frame."""
LONG_LEVER = 1.8
"""Multiple of the person's own maximum by which a knee above a clown's shoe may turn: its ankle is
10 cm higher in the same stride."""
UNDER = -1.0
"""Centimetres that a sole may be below the floor."""
STRANGE = {
    f"made_{case.name}": case.rig
    for case in strange(offsets_of("male", [1.5, -0.5]), offsets_of("female", []))
    if case.found_by == "names"
}
ARMS_DOWN = {"left_shoulder": turned("z", -70), "right_shoulder": turned("z", 70)}


def crouching(rig):
    """The nodes of a rig in a frame of another animation."""
    back = np.array(turned("x", 40))
    return moved(
        rig,
        {
            "Hips": {"position": (0.3, 0.6, 0.1), "rotation": turned("y", 50)},
            "LeftUpLeg": {"rotation": turned("x", -80)},
            "LeftLeg": {"rotation": turned("x", 95)},
            "Spine": {"rotation": back},
            "RightArm": {"rotation": multiply(turned("z", 60), turned("y", 20))},
        },
    )


def centimetres(rig):
    """The rig below an armature of 1 cm, turned by 90 degrees, as Blender writes FBX."""
    half = np.sqrt(0.5)
    inner = Body(offsets_of("female", []), names=lambda bone: bone)
    top = replace(rig.nodes[0], rotation=(-half, 0, 0, half), scale=(0.01,) * 3)
    return Body(inner.offsets, top=(top,), names=lambda bone: f"mixamorig:{bone}").rig()


def heeled(height: float) -> Made:
    made = person()
    return of(lifted(made.rig, height, ("LeftToeBase", "RightToeBase", "Armature")))


def with_lantern() -> Made:
    made = person()
    return replace(made, parts=((number(made.rig, "Armature"), np.array([0.4, 0.2, 0])),))


def cape_on_root() -> Made:
    """Skin that hangs from the armature, and a part on the head."""
    made = person()
    rig = made.rig
    parts = ((number(rig, "Head"), np.array([0, 0.3, 0])), (0, np.array([0, 0.0, -0.5])))
    return replace(made, parts=parts, owners={"spine2": number(rig, "Armature")})


SIBLINGS = {
    # heels, and rigs that stand above the floor
    "heels_4_cm": lambda: heeled(0.04),
    "heels_12_cm": lambda: heeled(0.12),
    "stands_60_cm_above_the_floor": lambda: of(lifted(person().rig, 0.6, ("Armature",))),
    # sizes
    "child_1_m": lambda: person(0.62),
    "giant_8_m": lambda: person(5.0),
    "doll_30_cm": lambda: person(0.18),
    # rest is the pose to which the skin was bound
    "crouches": lambda: replace(person(), posed=crouching),
    "crouches_in_centimetres": lambda: replace(
        of(centimetres(person().rig)),
        posed=lambda rig: moved(rig, {"mixamorig:left_hip": {"rotation": turned("x", -70)}}),
    ),
    # soles
    "clown_shoes": lambda: person(shoe=Shoe(0.1, 0.18, 0.02)),
    "platform_soles": lambda: person(shoe=Shoe(0.09, 0.1, 0.1)),
    "no_toes": lambda: of(
        Body(offsets_of("female", []), names=MIXAMO, without=("left_foot", "right_foot")).rig()
    ),
    # parts that hang from the root
    "lantern_on_the_armature": with_lantern,
    "skin_on_the_armature": cape_on_root,
    # skeletons and names
    **{name: lambda rig=rig: of(rig) for name, rig in STRANGE.items()},
    "skirt_and_arms_down": lambda: of(
        skirted(
            Body(offsets_of("female", []), pose=ARMS_DOWN, names=MIXAMO).rig(), "Hips", "Head"
        )
    ),
}  # fmt: skip


REFUSED = {
    "quadruped": "it has four legs",
    "digitigrade_biped": "on the other side than its name tells",
    "armature_uneven_scale": "'Armature' is scaled by 1, 1.2, 1",
    "person_in_centimetres": "is the unit right",
}


@cache
def own_turn() -> float:
    """Maximum degrees that a joint of the person turns between two frames of the stride."""
    turns = np.asarray(recorded().rotations, np.float64)
    alike = np.abs((turns[1:] * turns[:-1]).sum(-1)).clip(0, 1)
    return float(np.degrees(2 * np.arccos(alike)).max())


def check(found: Figures, carried: bool = False, pace: float = 1.0) -> None:
    """`pace`: how much faster than a person it steps, as its legs swing faster."""
    assert found.turn < TURN * pace, found
    assert found.lowest > UNDER, found
    assert found.slide < 8, found
    assert found.backward == 0, found
    assert found.facing > 0.85, found
    assert found.lean < 12, found
    assert found.left_behind < 0.5, found
    assert carried or found.stretch < 1.2, found


@cache
def made(name: str) -> tuple[bytes, np.ndarray]:
    """The file with a stride in it, of a case or a sibling, and its contacts."""
    case = CASES / f"{name}.glb"
    return retargeted(case.read_bytes() if case.exists() else SIBLINGS[name]().data())


ACCEPTED = sorted({file.stem for file in CASES.glob("*.glb")} - set(REFUSED))


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_walk_is_refused_with_the_reason(name: str) -> None:
    with pytest.raises(InvalidArgument, match=REFUSED[name]):
        made(name)


@pytest.mark.parametrize("name", [*ACCEPTED, *SIBLINGS])
def test_a_strangers_file(name: str) -> None:
    pace = 2.4 if name == "doll_30_cm" else 1.0
    if name == "clown_shoes":
        pace = LONG_LEVER * own_turn() / TURN
    carried = name in ("hangs_from_root", "skin_on_the_armature")
    check(figures(*made(name)), carried, pace)


@needs_validator
def test_all_files_are_valid(tmp_path: Path) -> None:
    """Khronos' validator reports nothing."""
    files = [tmp_path / f"{name}.glb" for name in (*ACCEPTED, *SIBLINGS)]
    for file in files:
        file.write_bytes(made(file.stem)[0])
    assert issues(*files) == []


def test_a_heel_is_no_length_of_a_leg() -> None:
    """The same body as in flat shoes, of scale 1."""
    flat, heels = (Character.read(made.data()) for made in (person(), heeled(0.08)))
    bodies = []
    for character in (flat, heels):
        joints, floor = character.joints()
        bodies.append(fit_betas({b: GLTF_FROM_CORE @ p for b, p in joints.items()}, floor))
    assert [body.scale for body in bodies] == [1.0, 1.0]
    for body in bodies:
        assert max(abs(length.error_cm) for length in body.lengths) < 5, body.lengths


def test_scale_1_wins_wherever_a_body_has_it() -> None:
    """This holds for both genders: the adult of the cases, and tall and small people."""
    given = json.loads((CASES / "adult_of_1_8_m.json").read_text())
    places = {j["bone"]: np.array([j["position"][axis] for axis in "xyz"]) for j in given["joints"]}
    for size in (0.92, 0.96, 1.0, 1.04):
        found = fit_betas({b: size * GLTF_FROM_CORE @ p for b, p in places.items()}, 0.0)
        legs = {length.name: length.error_cm for length in found.lengths}
        assert found.scale == 1.0, (size, found)
        assert abs(legs["thigh"] + legs["shin"]) <= 1.0, (size, found)


def test_a_giant_covers_the_way_in_a_giants_time(tmp_path: Path) -> None:
    """With the command, the goal is at the requested place. A step's duration grows with the root
    of the scale, so the pace exceeds by this factor that of a person that walks half as far.
    """
    file = tmp_path / "giant.glb"
    file.write_bytes(person(2.0).data())
    data, _ = walked(file, 7.0, ("0,5",))
    hips = PlayedCharacter(data).place("pelvis")[:, [0, 2]]
    assert np.linalg.norm(hips[-1] - [0, 5]) < 1.0
    paces = [
        np.quantile(np.linalg.norm(np.diff(way, axis=0), axis=1) * 40, 0.8)
        for way in (straight(2.5, 7.0 / 2**0.5).translation[:, :2], hips)
    ]
    assert 1.2 < paces[1] / paces[0] < 1.7  # √2


def test_sides_that_contradict_the_names_are_refused(tmp_path: Path) -> None:
    mirror = {"left": "right", "right": "left"}

    def other(bone: str) -> str:
        side, _, rest = bone.partition("_")
        return MIXAMO(f"{mirror[side]}_{rest}" if side in mirror else bone)

    rigs = {
        "its toes point backwards": Body(offsets_of("female", []), names=other).rig(),
        "four legs": animal(),
        "is high above the ground for an ankle": animal(True, named=False),
        "mirrored": scaled(person().rig, "Armature", (-1.0, 1.0, 1.0)),
        "is scaled by 1, 1, 0.9": scaled(person().rig, "Hips", (1.0, 1.0, 0.9)),
    }
    for says, rig in rigs.items():
        with pytest.raises(InvalidArgument, match=says):
            Character.read(Made(rig, {"left_ankle": 0}).data())


@pytest.mark.parametrize("packer", ["gltfpack_cc", "draco"])
def test_a_packed_character_is_the_same(packer: str) -> None:
    """`long_shoes.glb` by `gltfpack -cc -kn` (1.3) and by gltf-transform's `draco`, from npm."""
    plain = Character.read(CASES / "long_shoes.glb")
    packed = Character.read(CASES.with_name("packed") / f"{packer}.glb")
    assert packed.soles.floor == pytest.approx(plain.soles.floor, abs=1e-4)
    for bone, place in plain.joints()[0].items():
        np.testing.assert_allclose(packed.joints()[0][bone], place, atol=1e-4)
    places, nodes = points_of(packed)
    wanted, of = points_of(plain)
    for name in set(of):
        mine = (places[nodes == name], wanted[of == name])
        for edge in (np.min, np.max):
            np.testing.assert_allclose(*(edge(points, axis=0) for points in mine), atol=2e-3)


def points_of(character: Character) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of its mesh [V, 3], and the name of the node that moves each most [V]."""
    rig = character.rig
    places, nodes = Skins(character.document, character.binary, rig, character.numbers).points()
    return places, np.array([rig.nodes[node].name for node in nodes])


def test_a_file_that_stands_in_a_frame_keeps_its_own_nodes() -> None:
    """The file does not change; the animation contains the rest pose."""
    offsets = offsets_of("female", [])
    given = Character.read(replace(person(), posed=crouching).data())
    still = np.tile([0, 0, 0, 1.0], (2, 22, 1))
    written = Character.read(given.animate(np.array([[0, 0.9, 0]] * 2), still, offsets))
    assert written.document["nodes"] == given.document["nodes"]
