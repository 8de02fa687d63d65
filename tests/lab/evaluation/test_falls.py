"""Who gets up is told, with the moment and what was sent around it."""

import numpy as np
import pytest
from PIL import Image

from tests.lab.evaluation.people import ANNY, make_world
from tests.world.fakes import FakeEngine
from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer.body.skeleton import joint_names
from wayfarer.engines.engine import StepInputs, StepOutputs
from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.agent import AgentSpec, AgentState, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.falls import AFTER, BEFORE, FallWatch, draw_falls

SPINE = joint_names().index("spine1")
BOW = quaternion_from_rotvec(np.radians([-50, 0, 0])).astype(np.float32)


class BowsOnce(FakeEngine):
    """The first one who is three metres on his way bows, in one step."""

    bowed = False

    def step(self, gender: str, inputs: StepInputs) -> StepOutputs:
        outputs = super().step(gender, inputs)
        on_the_way = np.flatnonzero(inputs.seed_translation[:, -1, 1] > 3)
        if len(on_the_way) and not self.bowed:
            outputs.rotations[on_the_way[0], :, SPINE] = BOW
            self.bowed = True
        return outputs


def seen(seconds: float) -> FallWatch:
    """Two agents, of whom the second walks."""
    world, falls = make_world(BowsOnce()), FallWatch()
    world.observe(falls)
    session = world.create_session(SessionSpec(), 0.0).session_id
    specs = [AgentSpec(gender="male"), AgentSpec(position=(3.0, 0.0))]
    _, walker = (agent.agent_id for agent in world.create_agents(session, specs, 0.0))
    world.give(walker, Goal((3.0, 9.0, 0.0)), 0.0)
    list(world.advance(seconds))
    return falls


@pytest.mark.parametrize("seconds", [60.0, 10.0], ids=["", "soon after the run begins"])
def test_a_fall_is_told_with_what_was_sent_around_it(seconds: float) -> None:
    [fallen] = seen(seconds).falls
    row = fallen.row("a run")
    assert row["name"] == "a run, agent 1" and row["state"] == AgentState.WALKING.value
    assert row["lean_deg"] == pytest.approx(50, abs=1e-3) and row["hips"] > 0.9
    seqs = [chunk.seq for chunk in fallen.chunks]
    assert seqs == list(range(fallen.fall.seq - BEFORE + 1, fallen.fall.seq + AFTER + 1))
    there = fallen.chunks[BEFORE - 1]
    assert there.first_frame == round(row["at_s"] * 40) and there.translation[0, 1] > 2.8
    assert fallen.clip().frames == (BEFORE + AFTER) * NEW_FRAMES


def test_a_sheet_has_a_strip_of_each_fall(tmp_path) -> None:
    falls = seen(20.0).falls
    path = draw_falls("a run every 0.5 s", falls, ANNY, tmp_path)
    assert path == tmp_path / "falls_a_run_every_0_5_s.png"
    picture = np.asarray(Image.open(path).convert("L"))
    assert (picture < 128).any(), "there is somebody"
    assert draw_falls("another", [], ANNY, tmp_path) is None
    assert len(list(tmp_path.iterdir())) == 1
