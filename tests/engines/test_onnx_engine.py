import numpy as np
import pytest

from tests.engines.graphs import (
    IDENTITIES,
    UNSCORED_OUTPUTS,
    save,
    step_model,
    write_folder,
)
from tests.engines.standing import standing_inputs
from tests.world.fakes import BODIES, people, start_poses
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.engines.onnx_engine import UNSCORED, OnnxEngine
from wayfarer.errors import ArtifactError
from wayfarer.models import artifacts
from wayfarer.models.bundle import DEFAULT_MODEL, load_models
from wayfarer.terms import TERMS
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World


@pytest.fixture
def folder(tmp_path):
    return write_folder(tmp_path / "tiny")


def engine(folder):
    return OnnxEngine(artifacts.load_model_folder(folder, IDENTITIES), threads=1)


@pytest.mark.parametrize("agents", [1, 5])
def test_fields_go_in_and_come_out_by_name(folder, agents):
    inputs = dummy_inputs(agents, candidates=3)
    inputs.seed_translation[:, 1] = [1, 2, 3]
    inputs.target_speed[:] = np.arange(agents)
    inputs.noise[:, 2, 5] = 7
    outputs = engine(folder).step("female", inputs)
    expected = np.array([1, 2, 3]) + np.arange(agents)[:, None] * np.array([0, 0.2, 0])
    np.testing.assert_allclose(outputs.translation[:, 3], expected, atol=1e-6)
    np.testing.assert_array_equal(outputs.rotations[..., 3], 1)
    assert outputs.next_seed_markers.shape == (agents, 2, 67, 3)
    assert outputs.choice.tolist() == [7] * agents


def test_warm_up_runs_each_size_largest_first(folder):
    done = []
    engine(folder).warm_up([1, 4], [2, 3], lambda *what: done.append(what))
    assert [d[:2] for d in done[::2]] == [(4, 3), (1, 3), (4, 2), (1, 2)]
    assert [d[:2] for d in done[1::2]] == [d[:2] for d in done[::2]], "a call for each gender"
    assert all(seconds > 0 for *_, seconds in done)


def test_a_world_runs_on_it(folder):
    nobody_hesitates = WorldSettings(steering=Steering(reactions=1))
    world = World(engine(folder), BODIES, start_poses(), nobody_hesitates)
    world.create_session(SessionSpec("s"), 0.0)
    agent = world.create_agents("s", people(3), 0.0)[1]
    world.give(agent.agent_id, Goal((2.0, 3.0, 0.0), speed=1.0), 0.0)
    chunks = [c for c in world.advance(1.05) if c.agent_id == agent.agent_id]
    # The tiny graph walks 0.2 m along Y in a step of 1 m/s, and this is not asked for at once.
    np.testing.assert_allclose([c.translation[-1, 1] for c in chunks[:2]], [0.2, 0.4], atol=1e-5)


def test_a_graph_with_other_outputs_is_refused(folder):
    outputs = {name: shape for name, shape in UNSCORED_OUTPUTS.items() if name != "contacts"}
    contract = artifacts.contract_for("unscored_male.onnx", "tiny", IDENTITIES["male"])
    save(
        step_model(outputs=outputs),
        folder / "unscored_male.onnx",
        artifacts.contract_to_json(contract),
    )
    artifacts.write_manifest(folder, "tiny", "stick")
    with pytest.raises(
        ArtifactError, match=r"unscored_male.onnx: outputs: found .*, expected .*contacts"
    ):
        engine(folder)


def test_one_candidate_moves_alike_with_scores_and_without():
    models = load_models(DEFAULT_MODEL)
    silent, scoring = OnnxEngine(models, 2), OnnxEngine(models, 2).scoring
    for rows in (1, 7, 64, 513):
        inputs = standing_inputs("male", rows)
        found, told = silent.step("male", inputs), scoring.step("male", inputs)
        assert found.terms.shape == (rows, 0)
        assert told.terms.shape == (rows, len(TERMS)) and told.terms.any()
        for name in UNSCORED:
            np.testing.assert_array_equal(getattr(found, name), getattr(told, name), name)


def test_a_session_with_scores_takes_the_place_of_the_other():
    engine = OnnxEngine(load_models(DEFAULT_MODEL), 1)
    one = standing_inputs("male", 2)
    before = engine.step("male", one)
    assert engine.step("male", standing_inputs("male", 2, 4)).terms.any()
    after = engine.step("male", one)
    assert not after.terms.size
    np.testing.assert_array_equal(before.translation, after.translation)
    assert engine.single_threaded.scoring.step("female", one).terms.any()
