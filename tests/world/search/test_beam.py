import math
from dataclasses import fields, replace

import numpy as np
import pytest

from tests.world.fakes import HIPS_HEIGHT, FakeEngine, make_world, people
from tests.world.search.walkers import TERM, Lanes, Walker, problem, same, standing
from wayfarer.engines.dummy import dummy_inputs
from wayfarer.spec import NEW_FRAMES
from wayfarer.world.agents.agent import AgentState, SessionSpec
from wayfarer.world.agents.goal import Goal
from wayfarer.world.agents.slots import Mode
from wayfarer.world.goals.steering import Search, Steering, default_searches
from wayfarer.world.search.beam import BLOCK, fan_out, grow, plan
from wayfarer.world.search.beam_settings import HARD, BeamSettings
from wayfarer.world.search.problem import BeamLevel, Ending, PlanningProblem

ALIKE = Steering(searches={m: replace(s, own=0.0) for m, s in default_searches().items()})
"""Settings without agents' own noise, so that latents are drawn independently."""

# Search


def test_it_walks_to_the_goal_and_ends_there():
    [found] = plan(Walker(), problem(1), BeamSettings())
    assert found.ending is Ending.REACHED and found.distance <= 0.75
    assert found.translation.shape == (found.steps * NEW_FRAMES, 3)
    assert found.rotations.shape == (found.steps * NEW_FRAMES, 22, 4)
    assert found.contacts.shape == (found.steps * NEW_FRAMES, 2)
    way = np.linalg.norm(found.translation[:, :2] - [0, 3], axis=-1)
    assert (way[:-NEW_FRAMES] > 0.75).all(), "no primitive after the one that reached it"
    assert (found.modes == Mode.WALKING).all()


def test_frames_of_a_plan_join_each_other():
    """Each primitive starts where its parent, and no other node, ended."""
    [tree] = grow(Walker(), problem(1), BeamSettings(children=3, keep=5))
    for leaf in range(len(tree.leaves)):
        found = tree.plan(leaf)
        path = np.concatenate([[[0, 0, HIPS_HEIGHT]], found.translation])[:, :2]
        step = np.linalg.norm(np.diff(path, axis=0), axis=-1)
        smooth = step.reshape(-1, NEW_FRAMES)[:, 1:]
        assert smooth.max() < 0.04, "1.2 m/s and a nudge"
        assert step.max() < 0.05 * 4 + 0.04, "between primitives, a latent's leap"
        np.testing.assert_array_equal(found.end.seed.translation[0], found.translation[-2:])


def test_a_wide_beam_leaves_the_trap_in_which_greedy_search_stays():
    settings = BeamSettings(roots=8, depth=6, weights={"skating": 1.0})
    ways = problem(1, way=(0.0, 50.0))
    [greedy] = plan(Lanes(), ways, replace(settings, keep=1), ALIKE)
    [wide] = plan(Lanes(), ways, replace(settings, keep=8), ALIKE)
    np.testing.assert_allclose(greedy.costs, [0.1, 1, 1, 1, 1, 1], atol=1e-6)
    np.testing.assert_allclose(wide.costs, [0.5, 0, 0, 0, 0, 0], atol=1e-6)
    assert greedy.translation[-1, 0] == -1 and wide.translation[-1, 0] == 1


@pytest.mark.parametrize(("memory", "lane"), [(0.0, 1), (1.0, -1)])
def test_memory_weighs_the_whole_path_against_its_last_primitive(memory, lane):
    class Short(Lanes):
        FIRST, LATER = {-1: 0.1, 1: 0.9}, {-1: 0.2, 1: 0.1}

    settings = BeamSettings(roots=8, keep=8, depth=2, weights={"skating": 1.0}, memory=memory)
    [found] = plan(Short(), problem(1, way=(0.0, 50.0)), settings, ALIKE)
    assert found.translation[-1, 0] == lane


@pytest.mark.parametrize("children", [4, 8])
def test_keeping_one_is_the_online_search(children):
    """Every frame equals the world's for the same agents."""
    specs = people(3)
    goals = [Goal((s.position[0] + 1.0, 2.0, 0.0), heading=0.0) for s in specs]
    steering = Steering(reactions=1).with_search(candidates=children)
    world = make_world(Walker(), steering=steering)
    session = world.create_session(SessionSpec(), 0.0).session_id
    agents = [a.agent_id for a in world.create_agents(session, specs, 0.0)]
    for agent, goal in zip(agents, goals, strict=True):
        world.give(agent, goal, 0.0)
    chunks = {agent: [] for agent in agents}
    for chunk in world.advance(12.0):
        chunks[chunk.agent_id].append(chunk)

    asked = PlanningProblem.of(specs, world.prepare(specs), [[goal] for goal in goals])
    settings = BeamSettings(keep=1, children=children, until="standing")
    for agent, found in zip(agents, plan(Walker(), asked, settings), strict=True):
        assert found.ending is Ending.STANDING
        online = np.concatenate([c.translation for c in chunks[agent]])
        walked = len(found.translation) - NEW_FRAMES
        np.testing.assert_array_equal(found.translation[:walked], online[:walked])
        states = [c.state for c in chunks[agent]]
        assert states.index(AgentState.STANDING) == found.steps - 1


def test_a_plan_does_not_depend_on_the_other_agents():
    ways = [(0.0, 3.0), (2.0, 0.0), (0.0, -6.0), (0.1, 0.1), (-1.0, 4.0)]
    specs = people(len(ways))
    motions = make_world().prepare(specs)
    paths = [[Goal((s.position[0] + x, y, 0.0))] for s, (x, y) in zip(specs, ways, strict=True)]
    settings = BeamSettings(children=3, keep=8, limits={"skating": 0.1})
    together = plan(Walker(), PlanningProblem.of(specs, motions, paths), settings)
    assert len({found.steps for found in together}) > 2
    for row in range(len(specs)):
        one = PlanningProblem.of([specs[row]], [motions[row]], [paths[row]])
        assert same(plan(Walker(), one, settings)[0], together[row])


def test_the_same_problem_has_the_same_plan_and_another_seed_another():
    settings = BeamSettings(depth=5)
    first, again = (plan(Walker(), problem(2), settings) for _ in range(2))
    assert all(same(a, b) for a, b in zip(first, again, strict=True))
    other = plan(Walker(), problem(2, noise_seed=99), settings)
    assert not same(first[0], other[0])


def test_rows_go_to_the_engine_by_gender_in_bounded_blocks():
    engine = FakeEngine()
    plan(engine, standing(6), BeamSettings(children=10, keep=4, depth=2))
    assert {gender for gender, _, _ in engine.calls} == {"female", "male"}
    assert max(rows for _, rows, _ in engine.calls) <= BLOCK
    assert sum(rows for _, rows, _ in engine.calls) == 6 * (40 + 40)
    assert {candidates for _, _, candidates in engine.calls} == {1}


@pytest.mark.parametrize("roots", [None, 2, 20])
def test_the_first_level_has_its_own_number_of_children(roots):
    engine = FakeEngine()
    settings = BeamSettings(children=3, keep=4, roots=roots, depth=3)
    [tree] = grow(engine, standing(1), settings)
    tried = [rows for _, rows, _ in engine.calls]
    first = roots or 12
    assert tried == [first, 3 * min(first, 4), 3 * min(3 * first, 4)]
    assert [len(level.parent) for level in tree.levels] == [min(first, 4), 4, 4]


def test_latents_are_drawn_as_asked_or_as_steering_says():
    class Listener(FakeEngine):
        def step(self, gender, inputs):
            heard.append((set(inputs.policy.tolist()), inputs.noise[:, 0]))
            return super().step(gender, inputs)

    heard: list[tuple[set[float], np.ndarray]] = []
    walk = Search({}, candidates=4, temperature=1.5, policy=0.5)
    steering = Steering(searches=dict.fromkeys(Mode, walk))
    for asked in (
        BeamSettings(depth=1),
        BeamSettings(depth=1, policy=0.25, temperature=3.0),
        BeamSettings(depth=1, policy=0.0),
    ):
        plan(Listener(), problem(1), asked, steering)
    assert [policy for policy, _ in heard] == [{0.5}, {0.25}, {0.0}]
    told, wide, prior = (noise for _, noise in heard)
    assert told.any(-1).all()
    np.testing.assert_allclose(wide, 2 * told, rtol=1e-6)
    np.testing.assert_array_equal(prior, told)


def test_all_nodes_of_an_agent_are_ranked_by_the_table_of_its_best():
    """A stop must not lose against a walk because it is measured with heavier weights."""

    class Uneven(FakeEngine):
        def step(self, gender, inputs):
            outputs = super().step(gender, inputs)
            outputs.translation[inputs.noise[:, 0, 0] > 0, :, 1] += 0.1
            outputs.terms[:, TERM["skating"]] = 1.0
            return outputs

    def priced(mode: Mode) -> Search:
        weight = 1.0 if mode == Mode.WALKING else 9.0
        return Search({"skating": weight}, candidates=4, temperature=1.0, own=0.0)

    steering = Steering(searches={mode: priced(mode) for mode in Mode})
    settings = BeamSettings(children=4, keep=6, until="standing")
    [tree] = grow(Uneven(), problem(1), settings, steering)
    mixed = [level for level in tree.levels if len(set(level.mode.tolist())) > 1]
    assert mixed, "some node began to stop before the others"
    assert all(len(set(level.cost.tolist())) == 1 for level in mixed)
    assert {float(level.cost[0]) for level in tree.levels} == {1.0, 9.0}


# Ends


def test_a_goal_that_is_reached_already_needs_no_primitive():
    engine = Walker()
    near, far = Goal((0.3, 0.3, 0.0)), Goal((2.0, 3.0, 0.0))
    specs = people(2)
    asked = PlanningProblem.of(specs, make_world().prepare(specs), [[near], [far]])
    found, other = plan(engine, asked, BeamSettings())
    assert (found.steps, found.ending) == (0, Ending.REACHED)
    assert found.translation.shape == (0, 3) and found.rotations.shape == (0, 22, 4)
    assert found.distance == pytest.approx(math.hypot(0.3, 0.3), abs=1e-5)
    assert other.steps > 5 and {gender for gender, _, _ in engine.calls} == {"female"}


def test_until_standing_it_goes_on_to_a_stand_within_the_radius():
    [found] = plan(Walker(), problem(1), BeamSettings(until="standing"))
    assert found.ending is Ending.STANDING
    assert found.modes[-1] == Mode.STANDING and (found.modes[:-1] != Mode.STANDING).all()
    assert found.distance < 0.75 and found.end.gait.arrived[0]


def test_a_path_is_visited_goal_by_goal():
    specs = people(1)
    path = [Goal((0.0, 2.0, 0.0), stop=False), Goal((2.0, 2.0, 0.0)), Goal((2.0, 0.0, 0.0))]
    asked = PlanningProblem.of(specs, make_world().prepare(specs), [path])
    calm = BeamSettings(until="standing", temperature=0.5)  # with more it would hardly rest
    [found] = plan(Walker(), asked, calm)
    assert found.ending is Ending.STANDING and found.end.gait.waypoint[0] == 2
    way = [np.linalg.norm(found.translation[:, :2] - g.position[:2], axis=-1) for g in path]
    first = [np.flatnonzero(w <= 0.3)[0] for w in way]
    assert first == sorted(first)
    stands = np.flatnonzero(found.modes == Mode.STANDING)
    assert stands[0] >= first[1] // NEW_FRAMES > first[0] // NEW_FRAMES


def test_without_a_goal_or_out_of_reach_it_ends_at_its_depth():
    [idle] = plan(Walker(), standing(1), BeamSettings(depth=4))
    assert (idle.steps, idle.ending) == (4, Ending.DEPTH) and math.isnan(idle.distance)
    [far] = plan(Walker(), problem(1, way=(0.0, 90.0)), BeamSettings(depth=4))
    assert (far.steps, far.ending) == (4, Ending.DEPTH) and far.distance > 80


def test_a_broken_primitive_is_not_kept_and_an_agent_without_any_other_ends_before_it():
    engine = Walker()
    engine.nan_for_beta = 2.5
    specs = people(2)
    specs[1] = replace(specs[1], betas=(2.5,) + (0.0,) * 9)
    paths = [[Goal((s.position[0], 3.0, 0.0))] for s in specs]
    asked = PlanningProblem.of(specs, make_world().prepare(specs), paths)
    sound, lost = plan(engine, asked, BeamSettings(limits=HARD))
    assert sound.ending is Ending.REACHED
    assert (lost.ending, lost.steps) == (Ending.BROKEN, 0)
    assert np.isfinite(lost.end.seed.translation).all()


def test_leaves_at_the_goal_come_first():
    trees = grow(Walker(), problem(3), BeamSettings(children=4, keep=12, reach=0.5))
    for tree in trees:
        frames = [tree.plan(leaf).translation[-NEW_FRAMES:] for leaf in range(len(tree.leaves))]
        goal = np.array([tree.ends.seed.translation[0, -1, 0], 3.0])
        assert len(frames) == len(tree.distances) == 12
        there = [float(d) <= 0.5 for d in tree.distances]
        assert there[0] and there == sorted(there, reverse=True), goal


def test_a_plan_goes_on_where_another_ended():
    specs = people(1)
    settings = BeamSettings(depth=3, keep=1)
    goal = Goal((0.0, 9.0, 0.0))
    world = make_world()
    [whole] = plan(
        Walker(),
        PlanningProblem.of(specs, world.prepare(specs), [[goal]]),
        replace(settings, depth=6),
    )
    [first] = plan(Walker(), PlanningProblem.of(specs, world.prepare(specs), [[goal]]), settings)
    rest = PlanningProblem.of(specs, [first.end], [[goal]], first.next_chunk)
    # From its second level on a plan tries 4 children, on its first 4 as well: keep is 1.
    [second] = plan(Walker(), rest, settings)
    joined = np.concatenate([first.translation, second.translation])
    np.testing.assert_array_equal(joined, whole.translation)
    assert second.next_chunk == whole.next_chunk == 6


# Bounds


def test_memory_holds_nothing_but_kept_nodes():
    count, keep, depth = 3, 4, 20
    trees = grow(Walker(), standing(count), BeamSettings(children=16, keep=keep, depth=depth))
    levels = trees[0].levels
    assert all(tree.levels is levels for tree in trees)
    arrays = [getattr(level, f.name) for level in levels for f in fields(BeamLevel)]
    assert all(array.base is None for array in arrays), "a view would hold all that were tried"
    node = sum(getattr(BeamLevel.empty(1), f.name).nbytes for f in fields(BeamLevel))
    assert sum(array.nbytes for array in arrays) <= count * keep * depth * node


def test_the_watcher_hears_of_every_level_and_may_stop_the_search():
    heard: list[tuple[int, int]] = []
    plan(Walker(), standing(2), BeamSettings(depth=3), watch=lambda *now: heard.append(now))
    assert heard == [(0, 2), (1, 2), (2, 2)]

    def interrupt(level: int, agents: int) -> None:
        if level == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan(Walker(), standing(1), BeamSettings(), watch=interrupt)


def test_fanned_out_rows_hold_one_candidate_each_in_order():
    inputs = dummy_inputs(3, 2)
    inputs.goal[:, 0] = [0, 1, 2]
    inputs.noise[..., 0] = [[0, 1], [2, 3], [4, 5]]
    many = fan_out(inputs)
    assert many.goal[:, 0].tolist() == [0, 0, 1, 1, 2, 2]
    assert many.noise.shape[:2] == (6, 1) and many.noise[:, 0, 0].tolist() == [0, 1, 2, 3, 4, 5]
