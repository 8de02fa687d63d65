"""A known driver: a frozen body that glides as wished does not pass for a person."""

import numpy as np
import pytest
import torch
from torch import Tensor

from wayfarer.spec import FPS, NEW_FRAMES
from wayfarer_lab.evaluation.twosided import bare, ranges
from wayfarer_lab.evaluation.twosided.bare import roll
from wayfarer_lab.evaluation.twosided.verdicts import count, verdicts_of
from wayfarer_lab.evaluation.twosided.wishes import ORDERS, SECONDS
from wayfarer_lab.training.rotation import matrix_from_quaternion, quaternion_from_matrix


def glide(
    seed_markers: Tensor,
    seed_translation: Tensor,
    seed_rotations: Tensor,
    betas: Tensor,
    ways: Tensor,
    facings: Tensor,
) -> tuple[Tensor, Tensor, Tensor]:
    """The seed's last pose, moved by the way and turned to the facing of .2 s later."""
    root = matrix_from_quaternion(seed_rotations[:, 0, 0])
    right = root[:, :2, 0] / root[:, :2, 0].norm(dim=-1, keepdim=True)
    axes = torch.stack([right, torch.stack([-right[:, 1], right[:, 0]], -1)], -1)
    share = torch.arange(1, NEW_FRAMES + 1) / NEW_FRAMES
    way = (axes @ ways[:, 0, :, None])[..., 0]
    turn = -torch.atan2(facings[:, 0, 0], facings[:, 0, 1])
    angle = turn[:, None] * share
    c, s, o, i = angle.cos(), angle.sin(), 0 * angle, 0 * angle + 1
    spin = torch.stack([c, -s, o, s, c, o, o, o, i], -1).unflatten(-1, (3, 3))
    hips = seed_translation[:, -1:].repeat(1, NEW_FRAMES, 1)
    hips[..., :2] += way[:, None] * share[:, None]
    rotations = seed_rotations[:, -1:].repeat(1, NEW_FRAMES, 1, 1)
    rotations[:, :, 0] = quaternion_from_matrix(spin @ matrix_from_quaternion(rotations[:, :, 0]))
    return hips, rotations, seed_markers


def test_who_glides_arrives_as_wished_and_holds_next_to_nothing() -> None:
    tracks = roll({"female": glide}, people=2)
    assert [track.order for track in tracks] == [name for name in ORDERS for _ in (0, 1)]
    ends = {track.order: track.take for track in tracks}
    assert all(len(take) == SECONDS * FPS for take in ends.values())
    assert ends["walk 1.2"].hips[-1, 1] == pytest.approx(1.2 * 10.5, abs=0.2)
    assert ends["left"].hips[-1, 0] == pytest.approx(-10.5, abs=0.2)
    assert np.abs(ends["walk 1.2"].hips[:, 0]).max() < 0.05
    assert np.ptp(ends["turn 180"].heading) == pytest.approx(180, abs=25)
    judged = verdicts_of([person for track in tracks for person in track.people()], ranges.load())
    known = {name for name in ranges.load() if not name.startswith("stairs")}
    assert {v.situation for v in judged} == known
    assert count(judged).holds < 0.2 * count(judged).total
    speeds = [v for v in judged if v.figure == "speed_mps"]
    assert speeds and all(v.holds for v in speeds), "speed is all that a glider has"


def test_the_same_seed_gives_the_same_people() -> None:
    orders = {"stand": ORDERS["stand"]}
    one, two, other = (
        roll({"female": glide}, people=2, seed=seed, orders=orders) for seed in (3, 3, 4)
    )
    assert np.array_equal(one[1].take.joints, two[1].take.joints)
    assert not np.array_equal(one[1].take.joints, other[1].take.joints)


def test_genders_take_turns() -> None:
    orders = {"stand": ORDERS["stand"]}
    tracks = roll({"male": glide, "female": glide}, people=2, orders=orders)
    assert [track.take.clip.gender for track in tracks] == ["male", "female"]
    assert tracks[0].take.clip.body == bare.BODY
