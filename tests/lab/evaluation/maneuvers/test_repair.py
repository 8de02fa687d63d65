"""Rules that move bodies by known ways."""

import numpy as np
import pytest

from tests.lab.evaluation.people import ANNY
from wayfarer.spec import POSED_JOINTS
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.stepping.rules import MODEL, PLANNED
from wayfarer_lab.evaluation.maneuvers.repair import ALL, Repair

FRAMES = 8
SPECS = [AgentSpec(), AgentSpec(gender="female")]
SLOTS = np.array([0, 1])


def frames(x: float = 0.0, up: float = 0.9, elbow: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Two T-poses at `x`, with the left elbow turned by some degrees."""
    hips = np.zeros((2, FRAMES, 3), np.float32)
    hips[..., 0], hips[..., 2] = x, up
    turns = np.zeros((2, FRAMES, POSED_JOINTS, 4), np.float32)
    turns[..., 3] = 1
    turns[:, :, 18, 2], turns[:, :, 18, 3] = (
        np.sin(np.radians(elbow) / 2),
        np.cos(np.radians(elbow) / 2),
    )
    return hips, turns


def repaired(repair: Repair) -> Repair:
    """The model at 0; guards move by 2 cm, foot lock by 1 cm more, the ground bends an elbow."""
    for name, values in (
        (MODEL, frames()),
        ("guards", frames(0.02)),
        (PLANNED, frames(0.02)),
        ("foot lock", frames(0.03)),
        ("ground", frames(0.03, elbow=22.0)),
    ):
        repair(name, SLOTS, *values)
    return repair


def test_each_rule_has_what_it_moves_and_all_have_the_whole() -> None:
    rows = repaired(Repair(SPECS, ANNY, every=1)).rows()
    assert list(rows) == [ALL, "guards", "foot lock", "ground"]
    assert rows["guards"]["cm_mean"] == pytest.approx(2, rel=1e-3)
    assert rows["foot lock"]["cm_p95"] == pytest.approx(1, rel=1e-3)
    assert rows["ground"]["deg_mean"] == pytest.approx(22 / POSED_JOINTS, rel=1e-3)
    assert rows["ground"]["deg_p95"] == pytest.approx(0, abs=1e-3), "one joint of 22"
    assert rows[ALL]["cm_mean"] == pytest.approx(3.3, abs=0.4)


def test_what_is_replanned_is_not_sent() -> None:
    repair = Repair(SPECS, ANNY, every=1)
    repair(MODEL, SLOTS, *frames(5.0))
    repaired(repair)
    assert repair.rows()[ALL]["cm_mean"] < 4


def test_the_floor_is_no_repair_on_stairs() -> None:
    for climbs, metres in ((True, 0.0), (False, 300.0)):
        repair = Repair(SPECS, ANNY, climbs=climbs, every=1)
        for name, up in ((MODEL, 0.9), (PLANNED, 0.9), ("ground", 3.9)):
            repair(name, SLOTS, *frames(up=up))
        assert repair.rows()["ground"]["cm_mean"] == pytest.approx(metres, abs=1e-3)


def test_one_step_in_some_is_measured() -> None:
    repair = repaired(Repair(SPECS, ANNY, every=2))
    assert repair.rows() == {}
    assert repaired(repair).rows()[ALL]["cm_mean"] > 0
