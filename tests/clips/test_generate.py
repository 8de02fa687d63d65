import re

import numpy as np
import pygltflib
import pytest

from tests.clients.test_character import RIGS, document_of, glb
from tests.played import parts
from tests.world.fakes import BODIES, FakeEngine, make_world
from wayfarer.clips.clip import Clip
from wayfarer.clips.files import write_clip
from wayfarer.clips.generate import SearchKind, generate, generate_clip
from wayfarer.errors import InvalidArgument
from wayfarer.world.agents.agent import AgentSpec
from wayfarer.world.agents.goal import Goal

GOALS = [Goal((0.0, 2.0, 0.0)), Goal((1.0, 0.0, 0.0))]


def test_an_agent_visits_its_goals_in_turn():
    heard = []
    clip = generate_clip(make_world(), AgentSpec(noise_seed=4), GOALS, 15.0, heard.append)
    assert clip.frames == 600
    assert clip.meta["goals_reached"] == "2"
    assert clip.goals == tuple(goal.position for goal in GOALS)
    nearest = [
        np.linalg.norm(clip.translation[:, :2] - goal.position[:2], axis=-1) for goal in GOALS
    ]
    assert all(distance.min() <= 0.3 for distance in nearest)
    assert nearest[0].argmin() < nearest[1].argmin()
    assert heard == sorted(heard) and heard[-1] == 15.0


def test_without_goals_it_stands():
    clip = generate_clip(make_world(), AgentSpec(position=(2.0, 3.0)), [], 1.0)
    assert clip.frames == 40
    assert np.abs(clip.translation[:, :2] - [2.0, 3.0]).max() < 0.1


def test_the_same_seed_gives_the_same_clip_and_the_world_is_left_empty():
    world = make_world()
    first = generate_clip(world, AgentSpec(noise_seed=7), GOALS, 3.0)
    assert (len(world.registry.agents), len(world.registry.sessions)) == (0, 0)
    again = generate_clip(make_world(), AgentSpec(noise_seed=7), GOALS, 3.0)
    other = generate_clip(make_world(), AgentSpec(noise_seed=8), GOALS, 3.0)
    assert (first.translation == again.translation).all()
    assert (first.translation != other.translation).any()


def test_goals_out_of_reach_are_counted_not_hidden():
    clip = generate_clip(make_world(), AgentSpec(), [Goal((0.0, 50.0, 0.0))], 2.0)
    assert (clip.frames, clip.meta["goals_reached"]) == (80, "0")


def test_without_a_length_it_ends_a_second_after_the_arrival_and_says_when_that_was():
    goals = [Goal((0.0, 2.0, 0.0)), Goal((2.0, 2.0, 0.0))]
    clip = generate_clip(make_world(), AgentSpec(noise_seed=4), goals)
    first, last = map(float, clip.meta["arrivals"].split())
    assert clip.meta["goals_reached"] == "2" and 1 < first < last
    assert last + 1.0 <= clip.seconds <= last + 2.0
    np.testing.assert_allclose(clip.translation[-40:, :2], [[2.0, 2.0]] * 40, atol=0.5)


@pytest.mark.parametrize("seconds", [0.0, -3.0, 0.001])
def test_a_clip_without_frames_is_refused(seconds):
    with pytest.raises(InvalidArgument, match="seconds"):
        generate_clip(make_world(), AgentSpec(), [], seconds)


def test_bad_arguments_are_refused_before_any_model_is_loaded(tmp_path):
    with pytest.raises(InvalidArgument, match=r"must end in \.glb, \.bvh, \.npz, \.vrma"):
        generate(tmp_path / "walk.fbx")
    with pytest.raises(InvalidArgument, match="no folder"):
        generate(tmp_path / "nowhere" / "walk.glb")
    with pytest.raises(InvalidArgument, match="'3;2' is not a place"):
        generate(tmp_path / "walk.glb", goal=["3;2"])
    with pytest.raises(InvalidArgument, match=r"--heading must be in radians, .* not 90"):
        generate(tmp_path / "walk.glb", heading=90.0)
    with pytest.raises(InvalidArgument, match="--keep works with --search beam only"):
        generate(tmp_path / "walk.glb", keep=2)
    with pytest.raises(InvalidArgument, match="--candidates works with --search online only"):
        generate(tmp_path / "walk.glb", search=SearchKind.BEAM, candidates=8)
    with pytest.raises(InvalidArgument, match="no outfit 'toga'; there are tee"):
        generate(tmp_path / "walk.glb", outfit="toga")
    with pytest.raises(InvalidArgument, match="--outfit dresses the shipped body"):
        generate(tmp_path / "walk.glb", outfit="suit", character=tmp_path / "me.glb")
    with pytest.raises(InvalidArgument, match="children is 0"):
        generate(tmp_path / "walk.glb", search=SearchKind.BEAM, children=0)


class Stage:
    """A bundle with models that are not there."""

    bodies = BODIES

    def __init__(self, engine: FakeEngine) -> None:
        self.engine = engine

    def world(self, agents, steering):
        return make_world(self.engine, steering=steering)


@pytest.fixture
def engine(monkeypatch):
    made = FakeEngine()
    monkeypatch.setattr("wayfarer.clips.generate.open_bundle", lambda *_: Stage(made))
    return made


def test_the_command_chooses_its_search(tmp_path, engine, capsys):
    asked = {"goal": ["0,1"], "seconds": 6.0}
    generate(tmp_path / "online.npz", **asked, candidates=5)
    assert {call[1:] for call in engine.calls} == {(1, 5)}
    engine.calls.clear()
    generate(tmp_path / "beam.npz", **asked, search=SearchKind.BEAM, children=3, keep=2, hard=True)
    assert {call[1:] for call in engine.calls} == {(6, 1)}
    said = capsys.readouterr().out
    assert said.count("240 frames, 6.0 s, 1 of 1 goals reached") == 2
    assert re.search(r"goals reached \(after \d\.\d s\)", said)


@pytest.mark.parametrize("search", list(SearchKind))
def test_interrupted_it_leaves_the_file_as_it_was(tmp_path, engine, monkeypatch, search):
    def interrupt(gender, inputs):
        raise KeyboardInterrupt

    monkeypatch.setattr(engine, "step", interrupt)
    (tmp_path / "walk.npz").write_bytes(b"before")
    with pytest.raises(KeyboardInterrupt):
        generate(tmp_path / "walk.npz", search=search)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"before"]


@pytest.mark.parametrize("name", ["c.glb", "c.bvh", "c.NPZ"])
def test_the_name_chooses_the_form(tmp_path, clip: Clip, name):
    write_clip(tmp_path / name, clip)
    start = (tmp_path / name).read_bytes()[:4]
    assert start == {"glb": b"glTF", "bvh": b"HIER", "npz": b"PK\x03\x04"}[name[2:].lower()]


def test_a_clip_is_worn_in_the_outfit_that_was_asked_for(tmp_path, engine):
    generate(tmp_path / "walk.glb", outfit="suit", seconds=0.5)
    about = pygltflib.GLTF2().load(str(tmp_path / "walk.glb")).extras
    assert "suit" in str(about)


def test_a_character_gets_its_own_legs_and_keeps_its_file(tmp_path, monkeypatch):
    from wayfarer.clips import generate as module

    (tmp_path / "own.glb").write_bytes(glb(document_of(RIGS["mixamo"][0])))
    world = make_world()
    made = []

    class Bundle:
        def world(self, *_):
            return world

    def remember(world, spec, *rest):
        made.append(spec)
        return generate_clip(world, spec, *rest)

    monkeypatch.setattr(module, "open_bundle", lambda *_: Bundle())
    monkeypatch.setattr(module, "generate_clip", remember)
    generate(
        tmp_path / "walk.glb", goal=["0,2"], seconds=2.0, character=tmp_path / "own.glb", fps=20
    )
    document, _ = parts((tmp_path / "walk.glb").read_bytes())
    assert document["animations"][0]["name"] == "walk"
    assert made[0].betas[0] < -0.5  # the rig is that of a small woman
    with pytest.raises(InvalidArgument, match="has its own bones"):
        generate(tmp_path / "w.glb", character=tmp_path / "own.glb", root=module.RootMotion.BONE)
    with pytest.raises(InvalidArgument, match=r"is written as \.glb"):
        generate(tmp_path / "w.bvh", character=tmp_path / "own.glb")
