"""A world of imported networks. SSM2 has no markers under the feet; some have no counterpart."""

import json
from dataclasses import fields

import numpy as np
import pytest
import torch

from tests.lab.gamma import release
from tests.lab.gamma.files import write_body, write_checkpoints
from tests.world.fakes import FakeEngine, people
from wayfarer.assembly import model_folder
from wayfarer.body.library import SMPLX_FOLDER
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.body.smplx import load_smplx
from wayfarer.config.limits import Limits
from wayfarer.config.sources import load
from wayfarer.engines.engine import StepOutputs
from wayfarer.errors import ArtifactError
from wayfarer.models.bundle import START_POSES, load_bodies
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.world.agents.agent import SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.spawn import Spawner, load_start_poses
from wayfarer.world.output.legs import measure_legs, pose_legs
from wayfarer.world.search.problem import PlanningProblem
from wayfarer.world.stepping.mirror import has_mirror_image, is_mirrored
from wayfarer.world.stepping.settings import ANY_SIZE, WorldSettings
from wayfarer.world.world import World
from wayfarer_lab.gamma.models import gamma_graphs
from wayfarer_lab.training.smpl_joints import load_joints

COUNT = 8
SECONDS = 4.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("gamma")
    write_body(made, pose_blend=0.0)  # legs know no pose blend shapes
    return made


@pytest.fixture(autouse=True)
def _its_body(folder, monkeypatch):
    monkeypatch.setenv(SMPLX_FOLDER, str(folder))


class ImportedEngine(FakeEngine):
    """The imported step itself, without ONNX; it keeps its inputs."""

    def __init__(self, graphs) -> None:
        super().__init__()
        self.steps = {g: graphs[f"step_{g}.onnx"].module for g in ("male", "female")}
        self.asked = []

    def step(self, gender, inputs):
        self.asked.append(inputs)
        given = {f.name: torch.from_numpy(getattr(inputs, f.name).copy()) for f in fields(inputs)}
        with torch.no_grad():
            found = self.steps[gender](**given)
        return StepOutputs(**{name: values.numpy() for name, values in found._asdict().items()})


def still_graphs(folder):
    """Networks whose markers stay where the seed has them, and whose body is in the T-pose."""
    files = write_checkpoints(folder)
    still, body = release.Predictor(), release.Regressor()
    for layer in (still.d_out, body.pnet.out_fc):
        torch.nn.init.zeros_(layer.weight)
        torch.nn.init.zeros_(layer.bias)
    root = load_joints(folder / "SMPLX_MALE.npz", "smplx").mean[0]
    turn = torch.from_numpy(GLTF_FROM_CORE[:, :2].copy()).float().flatten()
    numbers = body.pnet.out_fc.bias.data
    numbers[:3] = -torch.from_numpy(root)  # hips at the origin
    numbers[3:135] = torch.tensor([1.0, 0, 0, 1, 0, 0]).repeat(22)
    numbers[3:9] = turn
    numbers /= 3  # of each pass
    release.save(files.predictor_2f, still)
    release.save(files.regressor_male, body)
    release.save(files.regressor_female, body)
    return gamma_graphs(files)


def test_soles_are_found_on_the_skin_as_our_own_markers_are(folder) -> None:
    path = folder / "SMPLX_FEMALE.npz"
    theirs, ours = load_bodies("smplx")["female"], load_smplx(path, "female")
    np.testing.assert_array_equal(theirs.sole_vertices, ours.marker_vertices[ours.sole_markers])
    assert [theirs.marker_names[k] for k in theirs.sole_markers] == [
        *("LHEE", "LMT1", "LMT5", "LTOE", "RHEE", "RMT1", "RMT5", "RTOE")
    ]
    betas = np.linspace(-1, 1, 10)
    for field in fields(measure_legs(ours, betas)):
        legs = (getattr(measure_legs(body, betas), field.name) for body in (theirs, ours))
        np.testing.assert_array_equal(*legs)


def test_a_server_is_told_where_the_bodies_are_and_shows_them(folder, monkeypatch) -> None:
    assert load({}).smplx_dir == folder  # WAYFARER_SMPLX_DIR
    monkeypatch.delenv(SMPLX_FOLDER)
    settings = load({"smplx_dir": folder, "model": "./nothing"})
    with pytest.raises(ArtifactError):
        model_folder(settings)
    library = BodyLibrary("smplx")
    assert library.model("female", "low") is library.model("female", "high")


def test_bodies_stand_with_their_skin_on_the_floor() -> None:
    bodies = load_bodies("smplx")
    spawner = Spawner(bodies, load_start_poses(START_POSES))
    for spec in people(4):
        motion, body = spawner.stand(spec), bodies[spec.gender]
        markers = motion.seed.markers[0, 0]
        assert markers[body.sole_markers, 2].min() > 0.01  # the markers are not under the foot
        legs = measure_legs(body, np.array(spec.betas))
        posed = pose_legs(legs, motion.seed.translation, motion.seed.rotations)
        assert posed.soles[..., 2].min() == pytest.approx(0, abs=2e-3)


def test_a_set_without_foot_markers_is_refused(folder, tmp_path, monkeypatch) -> None:
    write_body(tmp_path)
    table = json.loads((tmp_path / "markers.json").read_text())
    indices = table["markersets"][0]["indices"]
    indices["HEEL"] = indices.pop("LHEE")
    (tmp_path / "markers.json").write_text(json.dumps(table))
    monkeypatch.setenv(SMPLX_FOLDER, str(tmp_path))
    with pytest.raises(ArtifactError, match=r"lacks markers of the feet.*'LHEE'.*markers\.json"):
        load_bodies("smplx")


def test_people_of_an_imported_model_stand_on_their_feet_and_in_no_mirror(folder) -> None:
    bodies, engine = load_bodies("smplx"), ImportedEngine(still_graphs(folder))
    settings = WorldSettings(
        limits=Limits(agents=COUNT, agents_per_session=COUNT), phases=1, batch_sizes=ANY_SIZE
    )
    world = World(engine, bodies, load_start_poses(START_POSES), settings)
    world.create_session(SessionSpec("s"), 0.0)
    agents = world.create_agents("s", people(COUNT), 0.0)
    assert is_mirrored(np.arange(COUNT, dtype=np.uint64)).any()
    begin = world.slots.planned.seed.translation[:COUNT, -1].copy()
    for agent in agents[::2]:
        world.give(agent.agent_id, Goal((0.0, 9.0, 0.0)), 0.0)
    chunks = list(world.advance(SECONDS))
    assert len(chunks) > 4 * COUNT
    assert world.scheduler.resets == 0
    last = {chunk.agent_id: chunk for chunk in chunks}
    for row, agent in enumerate(agents):
        np.testing.assert_allclose(last[agent.agent_id].translation[-1], begin[row], atol=0.1)
        assert last[agent.agent_id].contacts.all()
    legs, seed = world.slots.legs.take(np.arange(COUNT)), world.slots.planned.seed
    soles = pose_legs(legs, seed.translation[:COUNT], seed.rotations[:COUNT]).soles[..., 2]
    np.testing.assert_allclose(soles.min((2, 3)), 0, atol=2e-3)  # on the floor, not 1 cm in it
    for asked in engine.asked:  # from where they are, not from behind a mirror
        assert (asked.seed_translation[:, 0, 0] > -0.1).all()


def test_a_search_looks_into_no_mirror_either() -> None:
    bodies = load_bodies("smplx")
    assert not has_mirror_image(bodies.values())
    assert has_mirror_image(load_bodies("anny52").values())
    specs = people(COUNT)
    spawner = Spawner(bodies, load_start_poses(START_POSES))
    motions = [spawner.stand(spec) for spec in specs]
    for mirrors in (True, False):
        asked = PlanningProblem.of(specs, motions, [()] * COUNT, mirrors=mirrors)
        assert asked.starts.mirrored.any() == mirrors
