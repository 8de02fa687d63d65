"""Agents in training who walk steadily, and what their way of walking costs (`likeness.py`).

Most agents turn, stop or set off. Who has been on the way to the same goal for a while is compared
with recorded people: the last 1.6 s of his markers by the critic, and their mean speed and some
figures of gait one by one.
"""

from collections.abc import Callable, Mapping, Sequence

import torch
from pydantic import BaseModel, ConfigDict, Field
from torch import Tensor

from wayfarer.motion.frame import canonical_frame, to_world
from wayfarer.motion.primitive import PrimitiveStep, StepResult
from wayfarer.motion.quality import Sites
from wayfarer.spec import FPS, GENDERS, NEW_FRAMES
from wayfarer_lab.training.crowd import TrainingCrowd
from wayfarer_lab.training.likeness import FRAMES, Critic, GaitFeatures
from wayfarer_lab.training.posture import Posture
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.tasks import WALKING, Tasks, Weight
from wayfarer_lab.training.walks import SPEEDS, Walks


class LikenessConfig(BaseModel):
    """Section [likeness] of an analytic training: what an unlikely walk costs."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    weight: Weight = 1.5  # of (verdict - 1)² / 4: 0 taken for recorded, 1 for made
    pace_weight: Weight = 3.0  # of a window's mean speed towards the goal off the target, m/s
    gait_weight: Weight = 0.5  # of figures of gait that are off, see `UNITS`
    rate: float = Field(default=3e-4, gt=0)  # the critic's learning rate


TRUNK, HEAD = (0.0, 3.0), (-21.0, -15.0)
"""Degrees, as means of windows, that the trunk may lean forward and the head may point upward, from
how both are in the T-pose. Recorded walkers lean by 4.6 degrees and look down by 17 (`wayfarer eval
maneuvers`); the policy without such bounds leans by 6 and looks down by 23."""

UNITS = {"bob": 1.0, "sway": 2.0, "knee": 10.0, "step": 10.0, "limp": 5.0}
"""Figures of gait that made walks shall share with recorded ones at the same speed, and how far off
costs 1: cm of the waist up and down and to the sides, degrees of bent knees, cm of a step and
between left and right steps. Without the last a policy limps to look like people (40 % between
left and right steps, at an AUC of .79)."""

SETTLED = FRAMES // NEW_FRAMES + 4
"""Steps on the way to a goal before a window of it counts: 0.8 s to turn and set off."""

NEAR = 0.9
"""Metres from the goal at which a walker slows down: no steady walk."""

FEW, MANY = 4, 24
"""With fewer windows than this nothing is judged; with fewer than that it counts less."""


class WatchedDecoder:
    """A predictor's `decode` whose last candidates can be read."""

    def __init__(self, decode: Callable[[Tensor, Tensor], Tensor]) -> None:
        self.decode = decode
        self.last: Tensor | None = None  # [A, K, F, 201], canonical frame of the seed

    def __call__(self, seed: Tensor, latents: Tensor) -> Tensor:
        """As the predictor's."""
        self.last = self.decode(seed, latents)
        return self.last


def shown_markers(
    step: PrimitiveStep, before: TrainingCrowd, result: StepResult, future: Tensor
) -> Tensor:
    """Markers of the bodies that a step with one candidate shows [A, F, 67, 3], world.

    Values are those of the bodies, slopes those of the predicted markers `future` [A, F, 201]
    (straight-through): no slope flows through the regressor.
    """
    with torch.no_grad():
        root = matrix_from_quaternion(before.rotations[:, 0, 0])
        frame = canonical_frame(before.translation[:, 0], root, step.floor_origin)
        turns = matrix_from_quaternion(result.rotations)
        shape = step.body.shaped(before.betas)
        skin, _ = step.body.skin(shape, result.translation, turns)
    markers = future.unflatten(-1, (-1, 3))
    predicted = to_world(frame, markers.flatten(1, 2)).unflatten(1, markers.shape[1:3])
    return skin + predicted - predicted.detach()


class SteadyWalks:
    """Windows of the crowds' steady walkers, and the critic that judges them."""

    def __init__(
        self,
        config: LikenessConfig,
        walks: Walks,
        names: Sequence[str],
        agents: int,
        horizon: int,
    ) -> None:
        """Crowds of `agents` per gender whose bodies' markers are `names`, `horizon` steps each."""
        self.config = config
        self.walks = walks
        self.features = GaitFeatures.from_names(names)
        self.gait = SteadyGait.from_names(names, self.features)
        self.critic = Critic(self.features.size)
        self.critic.fit(torch.cat([self.features.of(m) for m in walks.markers.values()]))
        self.optimizer = torch.optim.Adam(
            self.critic.parameters(), lr=config.rate, betas=(0.5, 0.9)
        )
        kept = FRAMES - NEW_FRAMES * horizon
        self.past = {g: torch.zeros(agents, kept, len(names), 3) for g in GENDERS}
        self.goals = {g: torch.zeros(agents, 3) for g in GENDERS}
        self.steps = {g: torch.zeros(agents, dtype=torch.long) for g in GENDERS}

    def count(self, gender: str, crowd: TrainingCrowd, tasks: Tasks) -> None:
        """After each step: for how many steps agents have been on the way to their goal.

        What is asked decides, not what is done: an agent that walks askew must not thereby escape
        the critic (it did: after 150 updates nobody was judged any more).
        """
        distance = (tasks.goal[:, :2] - crowd.place.detach()).norm(dim=-1)
        speed = (tasks.speed > SPEEDS[0] + 0.1) & (tasks.speed < SPEEDS[1] - 0.1)
        going = (tasks.kind == WALKING) & speed & (distance > NEAR) & ~crowd.broken()
        going &= (tasks.goal == self.goals[gender]).all(-1)
        self.steps[gender] = torch.where(going, self.steps[gender] + 1, 0)
        self.goals[gender] = tasks.goal.clone()

    def judge(
        self, gender: str, new: Tensor, tasks: Tasks, resting: Tensor
    ) -> tuple[Tensor, dict[str, float]]:
        """Mean cost of the steady walkers' windows and figures of them; the critic learns a step.

        New frames [A, horizon · 8, 67, 3] continue those of the last call; bodies' T-poses are
        `resting` [A, 3, 67].
        """
        rows = torch.nonzero(self.steps[gender] >= SETTLED).flatten()
        window = torch.cat([self.past[gender], new], 1)
        self.past[gender] = window[:, -self.past[gender].shape[1] :].detach()
        if len(rows) < FEW:
            return torch.zeros(()), {"steady": float(len(rows))}
        made = window[rows]
        speed = self.features.speed(made)
        recorded = self.walks.like(gender, speed.detach())
        features = self.features.of(made)
        learnt = self._teach(self.features.of(recorded), features)
        unlikely = (self.critic(features) - 1).square().mean() / 4
        pace = (self.progress(made, tasks.goal[rows]) - tasks.speed[rows]).abs().mean()
        off, gait = self.gait.compare(made, recorded, resting[rows])
        config = self.config
        cost = config.weight * unlikely + config.pace_weight * pace + config.gait_weight * off
        figures = {"steady": float(len(rows)), "pace": float(pace.detach())} | learnt | gait
        return cost * min(1.0, len(rows) / MANY), figures

    def progress(self, markers: Tensor, goal: Tensor) -> Tensor:
        """Mean speed [B] towards goals [B, 3] in windows [B, T, 67, 3], m/s.

        Speed alone is not enough: agents then walked like people, past their goals.
        """
        ends = markers[:, [0, -1], :, :2].transpose(-1, -2) @ self.features.waist
        left = (goal[:, None, :2] - ends).norm(dim=-1)
        return (left[:, 0] - left[:, 1]) * FPS / (markers.shape[1] - 1)

    def _teach(self, recorded: Tensor, made: Tensor) -> dict[str, float]:
        loss, figures = self.critic.loss(recorded, made)
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        return figures


class SteadyGait:
    """Figures of a window that are compared with recorded windows, or held in bounds."""

    def __init__(self, waist: Tensor, posture: Posture, parts: Mapping[str, list[int]]) -> None:
        self.waist, self.posture, self.parts = waist, posture, parts

    @classmethod
    def from_names(cls, names: Sequence[str], features: GaitFeatures) -> "SteadyGait":
        """For bodies whose markers have these names."""
        at, sites = {name: i for i, name in enumerate(names)}, Sites.from_names(names)
        parts = {
            "waist": sites.left_waist + sites.right_waist,
            "chest": sites.chest,
            "back of head": [at["LBHD"], at["RBHD"]],
            "front of head": [at["LFHD"], at["RFHD"]],
        }
        return cls(features.waist, Posture.from_names(names), parts)

    def compare(
        self, made: Tensor, recorded: Tensor, resting: Tensor
    ) -> tuple[Tensor, dict[str, float]]:
        """How far made windows are off, and figures.

        Windows [B, T, 67, 3] and T-poses [B, 3, 67] of the made ones. Trunk and head of each window
        have to stay in bounds; the other figures have to be those of the recorded on the average.
        """
        trunk = self.tilt(made, resting, "waist", "chest", upright=True)
        head = self.tilt(made, resting, "back of head", "front of head", upright=False)
        off = (_outside(trunk, TRUNK).mean() + _outside(head, HEAD).mean()) / 10
        found = {"trunk": float(trunk.detach().mean()), "head": float(head.detach().mean())}
        seen, known = self.figures(made), self.figures(recorded)
        for name, unit in UNITS.items():
            mean, wanted = seen[name].mean(), known[name].mean()
            off = off + (mean - wanted).abs() / unit
            found |= {name: float(mean.detach()), f"{name}_recorded": float(wanted)}
        return off, found

    def figures(self, markers: Tensor) -> dict[str, Tensor]:
        """Figures [B] of windows [B, T, 67, 3], by the names of `UNITS`."""
        step, limp = self.steps(markers)
        bob, sway = self.swings(markers)
        return {
            "bob": bob,
            "sway": sway,
            "knee": self.knee_peak(markers),
            "step": step,
            "limp": limp,
        }

    def swings(self, markers: Tensor) -> tuple[Tensor, Tensor]:
        """Centimetres [B] of the waist's way up and down, and to left and right, as of sines.

        In windows [B, T, 67, 3]: 2√2 standard deviations, without the trend.
        """
        waist, side = markers.transpose(-1, -2) @ self.waist, _side(markers)
        time = torch.linspace(-1, 1, waist.shape[1])
        found = []
        for place in (waist[..., 2], (waist[..., :2] * side).sum(-1)):
            slope = (place * time).sum(1, keepdim=True) / (time * time).sum()
            found.append((place - place.mean(1, keepdim=True) - slope * time).std(1))
        return 100 * 8**0.5 * found[0], 100 * 8**0.5 * found[1]

    def steps(self, markers: Tensor) -> tuple[Tensor, Tensor]:
        """Length of steps, and by how much left and right ones differ, centimetres [B].

        By how far each ankle gets ahead of the other in windows [B, T, 67, 3].
        """
        left, right = self.posture.ankles
        between = (markers[:, :, left, :2] - markers[:, :, right, :2]) * _way(markers)
        apart = 100 * between.sum(-1)
        first, other = apart.amax(1), -apart.amin(1)
        return (first + other) / 2, (first - other).abs()

    def knee_peak(self, markers: Tensor) -> Tensor:
        """Degrees [B] to which knees bend in windows [B, T, 67, 3]: mean of both peaks."""
        return torch.rad2deg(self.posture.knee_flexion(markers).amax(1)).mean(-1)

    def tilt(self, markers: Tensor, resting: Tensor, start: str, end: str, upright: bool) -> Tensor:
        """Degrees [B] by which a part of the body leans forward along the way, mean of a window.

        Windows [B, T, 67, 3]; counted from T-poses [B, 3, 67]. Of what stands `upright` forward is
        positive; of what lies level up is positive.
        """
        way = _way(markers)
        first, last, rest = self.parts[start], self.parts[end], resting.transpose(1, 2)
        part = markers[:, :, last].mean(2) - markers[:, :, first].mean(2)
        known = rest[:, last].mean(1) - rest[:, first].mean(1)
        ahead, up = (part[..., :2] * way).sum(-1), part[..., 2]
        if upright:
            angle = torch.atan2(ahead, up) - torch.atan2(known[:, 1], known[:, 2])[:, None]
        else:
            angle = torch.atan2(up, ahead) - torch.atan2(known[:, 2], known[:, 1])[:, None]
        return torch.rad2deg(angle).mean(1)


def _way(markers: Tensor) -> Tensor:
    """Horizontal unit vectors [B, 1, 2] of the ways of windows [B, T, 67, 3]; without a slope."""
    way = (markers[:, -1] - markers[:, 0]).mean(1)[:, :2].detach()
    return torch.nn.functional.normalize(way, dim=-1)[:, None]


def _side(markers: Tensor) -> Tensor:
    """Those to the right of them [B, 1, 2]."""
    way = _way(markers)
    return torch.stack([way[..., 1], -way[..., 0]], -1)


def _outside(values: Tensor, bounds: tuple[float, float]) -> Tensor:
    """By how much values lie outside of bounds."""
    return (values - bounds[1]).clamp(min=0) + (bounds[0] - values).clamp(min=0)
