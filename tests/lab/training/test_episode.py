"""Episodes in a world of points, with known figures."""

import pytest
import torch

from wayfarer.errors import InvalidArgument
from wayfarer.motion.policy import Condition, GoalPolicy
from wayfarer.spec import LATENT
from wayfarer.terms import TERMS
from wayfarer_lab.training import reward
from wayfarer_lab.training.environment import AgentBatch, Feedback, State, Task
from wayfarer_lab.training.episode import samples_of, simulate
from wayfarer_lab.training.ppo import PpoSettings
from wayfarer_lab.training.reward import REWARDS

SPEEDS = torch.tensor([1.0, 2.0, 0.0, 1.0])  # metres a primitive, towards +Y
BREAKS_AT = 3.0


class Points:
    """Agents at the origin slide along Y, goals 4 m ahead; the last one's is far, and it breaks."""

    task = Task(reached=0.5, area=20.0)

    def agents(self) -> AgentBatch:
        goal = torch.tensor([[0.0, 4.0, 0.0]] * 3 + [[0.0, 50.0, 0.0]])
        return AgentBatch(
            markers=torch.zeros(4, 1, 67, 3),
            translation=torch.zeros(4, 1, 3),
            rotations=torch.zeros(4, 1, 22, 4),
            gender=torch.zeros(4, dtype=torch.long),
            betas=torch.zeros(4, 10),
            goal=goal,
            target_speed=SPEEDS,
            facing=torch.zeros(4, 2),
            term_weights=torch.zeros(4, len(TERMS)),
        )

    def observe(self, agents: AgentBatch) -> State:
        """The seed contains the agent's place, so that samples can be distinguished."""
        seed = torch.zeros(len(agents.goal), 1, 201)
        seed[:, 0, 1] = agents.translation[:, 0, 1]
        return State(
            seed,
            Condition(
                agents.goal,
                agents.target_speed,
                agents.facing,
                agents.term_weights,
                torch.zeros(len(seed), 8),
            ),
        )

    def step(self, agents: AgentBatch, latents: torch.Tensor) -> tuple[AgentBatch, Feedback]:
        assert latents.shape == (len(agents.goal), LATENT)
        place = agents.translation.clone()
        place[:, 0, 1] += agents.target_speed
        hips = place[:, 0]
        distance = (agents.goal - hips)[:, :2].norm(dim=-1)
        broken = (agents.goal[:, 1] > 10) & (hips[:, 1] >= BREAKS_AT)
        rewards = torch.full((len(hips), len(reward.FUNCTIONS_OF_A_STEP)), 0.5)
        rewards[:, 0] = hips[:, 1] / 10
        return agents._replace(translation=place), Feedback(rewards, distance, broken, hips)


@pytest.fixture(scope="module")
def episode():
    torch.manual_seed(0)
    world = Points()
    return simulate(world, GoalPolicy(), world.agents(), primitives=5)


def test_agents_go_until_they_arrive_break_or_run_out_of_time(episode):
    assert episode.alive.sum(0).tolist() == [4, 2, 5, 3]
    assert episode.reached.tolist() == [True, True, False, False]
    assert episode.broken.tolist() == [False, False, False, True]
    assert episode.closest.tolist() == [0.0, 0.0, 4.0, 48.0]


def test_trails_end_where_agents_end(episode):
    assert episode.hips.shape == (6, 4, 3)
    assert episode.hips[:, 1, 1].tolist()[:3] == [0.0, 2.0, 4.0]
    assert episode.hips[3:, 1].isnan().all() and episode.hips[:, 2].isfinite().all()


def test_the_goal_s_reward_counts_for_every_primitive_of_the_episode(episode):
    """Eq. 9: 1 if reached, otherwise (L - d) / L of the closest; 0 after the agent's end."""
    got = episode.rewards[..., REWARDS.index("goal")]
    assert got[:4, 0].tolist() == [1.0] * 4 and got[4, 0] == 0
    assert torch.allclose(got[:, 2], torch.full((5,), 0.8))
    assert (got[:, 3] == 0).all()  # 48 m away


def test_only_who_ran_out_of_time_has_a_future(episode):
    assert (episode.future != 0).tolist() == [False, False, True, False]


def test_samples_are_in_the_order_of_alive(episode):
    """The row of a sample's advantage and return is the row of its state."""
    weights = torch.zeros(len(REWARDS))
    weights[0] = 1.0
    settings = PpoSettings(discount=0.5, gae=1.0)
    batch = samples_of(episode, weights, arrival=1.0, settings=settings)
    count = int(episode.alive.sum())
    assert len(batch.seed) == len(batch.latent) == len(batch.returns) == count
    for place, speed, goal, got in zip(
        batch.seed[:, 0, 1],
        batch.condition.target_speed,
        batch.condition.goal[:, 1],
        batch.returns,
        strict=True,
    ):
        if speed == 0:
            continue  # depends on the critic
        # by hand: half of each reward (1 - γ), then what the end is worth
        at, factor, expected = float(place), 1.0, 0.0
        while True:
            at += float(speed)
            expected += factor * at / 10 * 0.5
            factor *= 0.5
            if at >= (4 if goal < 10 else BREAKS_AT):
                break
        expected += factor * (1.0 if goal < 10 else 0.0)
        assert got.item() == pytest.approx(expected, abs=1e-6)


def test_clones_go_on_until_all_have_arrived_as_in_the_paper():
    """Agents 0 and 1 arrive after 4 and 2 primitives, agent 2 never; 3 breaks. Both keep going."""
    torch.manual_seed(0)
    scene = Points()
    together = simulate(scene, GoalPolicy(), scene.agents(), primitives=5, together=2)
    assert together.alive.sum(0).tolist() == [4, 4, 5, 3]
    assert together.steps.tolist() == [4, 2, 5, 5]
    assert together.reached.tolist() == [True, True, False, False]
    weights = torch.zeros(len(REWARDS))
    weights[0] = 1.0
    settings = PpoSettings(discount=0.5, normalised_over="clones")
    last = together.alive[:4].sum()  # rows of the primitives before the fifth
    batch = samples_of(together, weights, None, settings, clones=2)
    assert batch.returns[last - 3] == pytest.approx(0.5 * 4 / 10)  # Eq. 13: nothing comes after


def test_returns_are_shares_of_what_there_is(episode):
    weights = torch.rand(len(REWARDS)) * 5
    returns = samples_of(episode, weights, 1.0, PpoSettings()).returns
    sure = episode.reached | episode.broken
    ended = sure.expand_as(episode.alive)[episode.alive]
    assert ((returns[ended] >= 0) & (returns[ended] <= 1)).all()


def test_arriving_pays_more_than_dawdling(episode):
    """Rewards are positive: without the arrival's share, the way there would be worth more."""
    weights = torch.ones(len(REWARDS))
    settings = PpoSettings(discount=0.9)
    with_it = samples_of(episode, weights, 1.0, settings).returns
    without = samples_of(episode, weights, 0.0, settings).returns
    first = torch.zeros_like(episode.alive)
    first[0] = True
    rows = first[episode.alive]
    slow, fast = with_it[rows][0], with_it[rows][1]
    assert fast > slow
    assert without[rows][1] < without[rows][0]


def approached(episode, gae=1.0):
    """Returns [T, A] where only r_goal counts and is credited by approach; γ = 1/2."""
    weights = torch.zeros(len(REWARDS))
    weights[REWARDS.index("goal")] = 1.0
    settings = PpoSettings(discount=0.5, gae=gae)
    returns = torch.zeros_like(episode.values)
    batch = samples_of(episode, weights, 1.0, settings, credit="approach")
    returns[episode.alive] = batch.returns
    return returns


def test_credit_by_approach_pays_a_primitive_for_what_it_adds_to_the_goal_s_reward(episode):
    """From 4 m, r_goal .8, agent 0 adds .05 a metre like the arrival; 1 is twice as fast."""
    returns = approached(episode)
    steps = torch.tensor([0.05, 0.05, 0.05, 0.05])
    assert returns[3, 0] == pytest.approx(0.05, abs=1e-6)
    assert returns[0, 0] == pytest.approx(float(steps @ 0.5 ** torch.arange(4.0)), abs=1e-6)
    assert returns[0, 1] == pytest.approx(0.1 + 0.5 * 0.1, abs=1e-6)


def test_credit_by_approach_lets_a_fall_cost_what_was_earned(episode):
    """Agent 3, 50 m away, earned nothing; were its goal near, all of that would be lost."""
    assert approached(episode)[:3, 3].abs().max() == 0
    earned = episode.to_goal.clone()
    earned[1:, 3] = 0.4
    returns = approached(episode._replace(to_goal=earned))
    assert returns[2, 3] == pytest.approx(-0.5 * 0.4)
    assert returns[0, 3] == pytest.approx(0.4 - 0.125 * 0.4)


def test_credit_by_approach_equals_that_of_all_but_for_what_was_known_before():
    """Both sums of one endless walk: Σ γ^t r_goal so far = r_goal at the start + what is added."""
    torch.manual_seed(0)
    scene = Points()
    episode = simulate(scene, GoalPolicy(), scene.agents(), primitives=5)
    so_far = episode.to_goal[1:, 0]  # of an agent that arrives, and always gets 1
    paid = 0.5 * float(so_far[:4] @ 0.5 ** torch.arange(4.0)) + 0.5**4 * 1.0
    assert paid - episode.to_goal[0, 0] == pytest.approx(float(approached(episode)[0, 0]), abs=1e-6)


def test_credit_by_approach_needs_the_value_of_arrival(episode):
    with pytest.raises(InvalidArgument, match="arrival"):
        samples_of(episode, torch.ones(len(REWARDS)), None, PpoSettings(), credit="approach")
