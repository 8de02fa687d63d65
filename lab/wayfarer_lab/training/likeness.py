"""A critic that tells agents from recorded people, for the training of a policy.

It sees the skin's markers over 0.8 s: of agents, and of recorded people on bodies of random shapes
who went the same way, and turned as far, in that time. Its verdict is a
cost that has slopes, so the policy learns from it what no other cost says: how wide people walk,
how far their knees bend, where they look (adversarial motion priors, Peng et al. 2021,
with slopes in place of rewards). It sees two agents at once, and so also how much people differ
(PacGAN, Lin et al. 2018): otherwise everybody would soon walk like the mean of all.
"""

from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn

from wayfarer.body.library import load_body
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.quality import Sites
from wayfarer.spec import GENDERS
from wayfarer_lab.training.dataset import Frames, WindowSampler, random_betas
from wayfarer_lab.training.rotation import matrix_from_quaternion
from wayfarer_lab.training.views import EVERY, BodyFrames

PACK: Final = 2
"""Windows that it sees at once."""

BLUR: Final = 0.008
"""Metres of noise on markers: it hides the tremor of a capture, which no policy can learn."""

SOLE_BLUR: Final = 0.003
"""The same of heights of soles, where millimetres tell a step from a slide."""

KNOWN: Final = 16_384
"""Recorded windows in which it looks for the same way."""

RENEWAL: Final = 100
"""Judgements after which other windows are drawn."""

AMONG: Final = 24
"""Number of nearest ways, of which one is taken at random."""

LEG: Final = (
    *("THI", "KNE", "KNI", "SHN", "CLF", "ANK", "HEE", "TOE", "MT1", "MT5"),
    *("SOLE_HEEL", "SOLE_MT1", "SOLE_MT5", "SOLE_TOE"),
)
"""Markers of a leg."""

SLOPE: Final = 3.0
"""Weight of the squared slope at recorded windows, which keeps the critic smooth (R1, Mescheder et
al. 2018)."""


class Critic(nn.Module):
    """Windows [A, PACK, T, M, 3] → verdicts [A]: 1 for recorded ones, -1 for made ones."""

    mean: Tensor
    spread: Tensor
    blur: Tensor

    def __init__(self, windows: int, markers: int, sites: Sites, hidden: int = 384) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(windows, markers, 3))
        self.register_buffer("spread", torch.ones(windows, markers, 3))
        blur = torch.full((markers, 3), BLUR)
        blur[sites.left_sole + sites.right_sole, 2] = SOLE_BLUR
        self.register_buffer("blur", blur)
        self.net = nn.Sequential(
            nn.Linear(PACK * windows * markers * 3, hidden),
            nn.LeakyReLU(0.2),
            nn.Linear(hidden, hidden),
            nn.LeakyReLU(0.2),
            nn.Linear(hidden, 1),
        )

    def scale(self, windows: Tensor) -> None:
        """Takes mean and spread from windows [A, T, M, 3]."""
        self.mean.copy_(windows.mean(0))
        self.spread.copy_(windows.std(0).clamp(min=0.02))

    def forward(self, windows: Tensor) -> Tensor:
        """The verdicts."""
        noisy = windows + self.blur * torch.randn_like(windows)
        verdict: Tensor = self.net(((noisy - self.mean) / self.spread).flatten(1))
        return verdict[:, 0]


class RecordedWindows:
    """Recorded windows on bodies of one gender, found by the way that they go."""

    def __init__(self, frames: Frames, body: MarkerBody, length: int) -> None:
        self.frames, self.body = frames, body
        self.sampler = WindowSampler(frames, length)
        self.offsets = torch.arange(0, length, EVERY)
        self.soles = frames.markers[..., 2].amin(-1)
        names = list(load_body("anny52", GENDERS[0]).marker_names)
        self.legs = [torch.tensor([names.index(side + name) for name in LEG]) for side in "LR"]
        self.heels = [names.index(side + "SOLE_HEEL") for side in "LR"]
        self.renew()

    def renew(self) -> None:
        """Draws other windows."""
        self.starts = self.sampler.draw(KNOWN)
        rows = self.starts[:, None] + self.offsets
        hips, turns = self.frames.hips[rows], self.frames.hips_rotation[rows]
        self.ways = BodyFrames(hips, hips, turns).ways()

    def like(self, ways: Tensor) -> BodyFrames:
        """Windows that go ways [A, 5]."""
        far, pace = torch.cdist(ways, self.ways), self.ways[:, 2:4].norm(dim=-1)
        # as many who went farther as less far: slow ones are more, and agents would become slow
        farther = torch.rand(len(ways), 1) < 0.5
        beside = (pace > ways[:, 2:4].norm(dim=-1, keepdim=True)) == farther
        near = torch.where(beside, far, torch.inf).topk(AMONG, largest=False).indices
        return self.view(near.gather(1, torch.randint(AMONG, (len(ways), 1)))[:, 0])

    @torch.no_grad()
    def view(self, windows: Tensor) -> BodyFrames:
        """Windows [A], on bodies of random shapes."""
        rows = self.starts[windows][:, None] + self.offsets
        hips = self.frames.hips[rows]
        rotations = matrix_from_quaternion(self.frames.rotations[rows])
        markers, _ = self.body.skin(self.body.shaped(random_betas(len(rows))), hips, rotations)
        lift = self.soles[rows].amin(-1) - markers[..., 2].amin((-1, -2))
        up = lift[:, None, None] * torch.tensor([0.0, 0.0, 1.0])
        markers, hips, turns = markers + up[:, :, None], hips + up, rotations[:, :, 0]
        wide = self._as_wide(self.frames.markers[rows], markers, hips, turns)
        return BodyFrames(wide, hips, turns)

    def _as_wide(self, recorded: Tensor, markers: Tensor, hips: Tensor, turns: Tensor) -> Tensor:
        """Markers [A, T, 67, 3] whose feet are as far apart, to the side, as the recorded ones.

        A man's rotations put a woman's feet 2.6 cm nearer to each other than his.
        """
        right = turns[..., :2, 0]

        def width(bodies: Tensor) -> Tensor:
            left_heel, right_heel = (bodies[:, :, heel, :2] for heel in self.heels)
            return ((right_heel - left_heel) * right).sum(-1).mean(-1)

        half = 0.5 * (width(recorded) - width(markers))
        wide = markers.clone()
        for side, leg in zip((-1.0, 1.0), self.legs, strict=True):
            # a leg turns at the hip
            below = (1 - markers[:, :, leg, 2] / hips[..., 2:]).clamp(0, 1)
            moved = side * half[:, None, None] * below
            wide[:, :, leg, :2] += moved[..., None] * right[:, :, None]
        return wide


@dataclass(frozen=True)
class Judgement:
    """Verdicts of the critic on agents."""

    cost: Tensor  # [A] from 0, like recorded people, to 1; 0 for agents that are not judged
    right: float  # share of windows that it recognised
    mean: float  # cost of agents that are judged


class Likeness:
    """The critic of bodies of one gender, and its training."""

    def __init__(
        self, frames: Frames, body: MarkerBody, sites: Sites, length: int, rate: float
    ) -> None:
        """Sees windows of `length` frames, and learns at `rate`."""
        self.body = body
        self.recorded = RecordedWindows(frames, body, length)
        some = self.recorded.view(torch.arange(1024))
        frames_seen, markers = some.markers.shape[1:3]
        self.critic = Critic(frames_seen, markers, sites)
        self.critic.scale(some.windows(PACK).flatten(0, 1))
        self.optimizer = torch.optim.Adam(self.critic.parameters(), lr=rate, betas=(0.5, 0.99))
        self.asked = 0

    def view(
        self, hips: Tensor, rotations: Tensor, betas: Tensor, predicted: Tensor | None = None
    ) -> BodyFrames:
        """Bodies at frames: hips [A, T, 3], rotations [A, T, 22, 4], betas [A, 10]. Their markers
        have the slopes of predicted markers [A, T, 67, 3].
        """
        with torch.no_grad():
            turns = matrix_from_quaternion(rotations)
            markers = self.body.skin(self.body.shaped(betas), hips, turns)[0]
        if predicted is not None:
            markers = predicted + (markers - predicted).detach()
        return BodyFrames(markers, hips, turns[:, :, 0])

    def judge(self, view: BodyFrames, rows: Tensor) -> Judgement:
        """Judges those of rows [A] that are true, after it has learnt from them."""
        self.asked += 1
        if self.asked % RENEWAL == 0:
            self.recorded.renew()
        ways = view.ways()
        chosen = torch.nonzero(rows).squeeze(-1)
        order = (ways[chosen] @ torch.randn(ways.shape[1])).argsort()  # neighbours go alike
        chosen = chosen[order[: len(order) // PACK * PACK]]
        if not len(chosen):
            return Judgement(torch.zeros(len(rows)), 0.0, 0.0)
        made = view.of(chosen).windows(PACK)
        right = self._learn(made.detach(), self.recorded.like(ways[chosen]).windows(PACK))
        self.critic.requires_grad_(False)
        cost = 0.25 * (self.critic(made) - 1).clamp(-2, 2) ** 2
        self.critic.requires_grad_(True)
        each = torch.zeros(len(rows)).index_put((chosen,), cost.repeat_interleave(PACK))
        return Judgement(each, right, float(cost.detach().mean()))

    def _learn(self, made: Tensor, recorded: Tensor) -> float:
        """Takes a step (LSGAN, Mao et al. 2017). Returns the share of windows recognised."""
        recorded.requires_grad_()
        truth, guess = self.critic(recorded), self.critic(made)
        slope = torch.autograd.grad(truth.sum(), recorded, create_graph=True)[0]
        loss = ((truth - 1) ** 2).mean() + ((guess + 1) ** 2).mean()
        loss = loss + SLOPE * ((slope * self.critic.spread) ** 2).flatten(1).sum(1).mean()
        self.optimizer.zero_grad()
        loss.backward()
        self.optimizer.step()
        return float(((truth > 0).float().mean() + (guess < 0).float().mean()) / 2)
