"""Costs of a step where a policy learns to follow: how markers deviate from the request."""

from typing import NamedTuple

import torch
from torch import Tensor

from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.quality import LEANING, Sites, take
from wayfarer.motion.trajectory import Asked
from wayfarer.spec import FPS, STEP_SECONDS

NEAR_FLOOR = 0.02
"""Metres over the floor at which a sole's speed counts e⁻¹ as much as on it."""

FLOATING = 0.005
"""Metres by which the lowest sole may be off the floor."""

STRAIGHT, BENT = 0.988, 0.93
"""Height of the waist, as a part of that over straight legs, below which a body squats: where it
stands, and elsewhere. 98 in 100 recorded frames are higher."""

BESIDE = 0.08
"""Metres ahead of each other at which the feet of a person that stands are side by side: nine in
ten recorded people stop so."""

FACED = 0.15
"""Chord of 8.6°. Up to this angle, every degree off the requested facing costs the same."""

LINGERS = 0.4
"""m/s: a slower body that is near its goal comes no nearer by itself."""

ROUND_GOAL = 0.04, 0.3
"""Metres from its goal up to which a body may sway at no cost, and from which it is on its way."""

STEP = 0.28, 0.31
"""Length of a recorded step on legs of .98 m, in metres: at 0 m/s, and what each m/s adds."""

LEGS = 0.98
"""Metres from the soles to the waist of the people whose steps `STEP` describes."""

LAST_STEPS = 0.8
"""Metres to a goal before which steps may be short, and narrow."""

ABREAST = 0.15
"""Metres: if one foot is ahead of the other by less than this, they make no step."""

WIDE = 0.11
"""Metres to the side from the ball of the foot behind to the heel of the foot in front: the median
of recorded people: they have 7 to 14 cm."""


class Wish(NamedTuple):
    """The requests of A agents for a step, and their state before it; canonical frame."""

    asked: Asked
    goal: Tensor  # [A, 2] m from the hips before the step
    speed: Tensor  # [A] m/s of the hips before the step
    waist_up: Tensor  # [A] m, see `waist_height`
    headed: Tensor  # [A] bool: whether a heading is requested
    stands: Tensor  # [A] bool: whether an agent is asked to stand
    walks: Tensor  # [A] bool: whether it is asked to go ahead, and not slowly
    straight: Tensor  # [A] bool: whether it is not asked for a curve


class Costs(NamedTuple):
    """Deviations of a step [A]; units as of the config's weights."""

    way: Tensor  # [A, 2] m/s beyond the requested way; all other costs are [A]
    facing: Tensor
    faced: Tensor
    lingers: Tensor
    slide: Tensor
    floating: Tensor
    upright: Tensor
    squat: Tensor
    apart: Tensor
    short: Tensor
    narrow: Tensor
    seam: Tensor

    def means(self) -> Tensor:
        """Means over agents, the way by its length [12]."""
        sizes = self._replace(way=self.way.norm(dim=-1))
        return torch.stack([size.detach().nan_to_num().mean() for size in sizes])


def waist_height(body: MarkerBody, betas: Tensor, sites: Sites) -> Tensor:
    """Metres from the soles to the waist's markers of bodies `betas` [A, 10] on straight legs."""
    hips, unturned = torch.zeros(len(betas), 1, 3), torch.eye(3).expand(len(betas), 1, 22, 3, 3)
    markers = body.skin(body.shaped(betas), hips, unturned)[0][:, 0]
    soles = take(markers, sites.left_sole + sites.right_sole)[..., 2].amin(-1)
    return take(markers, sites.left_waist + sites.right_waist)[..., 2].mean(-1) - soles


def costs_of(
    seed: Tensor,
    future: Tensor,
    landed: Tensor,
    wish: Wish,
    sites: Sites,
) -> Costs:
    """Costs of markers: seed [A, S, 67, 3], future [A, F, 67, 3], and the last ones with feet where
    they are locked, landed [A, 67, 3]; canonical frame.
    """
    last, end = seed[:, -1], future[:, -1]
    waist = sites.left_waist + sites.right_waist

    def centre(markers: Tensor, which: list[int]) -> Tensor:
        return take(markers, which).mean(-2)

    way = centre(end, waist) - centre(last, waist)
    across = (centre(end, sites.right_waist) - centre(end, sites.left_waist))[:, :2]
    across = across / (across.norm(dim=-1, keepdim=True) + 1e-6)
    facing = torch.stack([-across[:, 1], across[:, 0]], -1)
    asked_facing = wish.asked.facings[:, 0]
    trunk = centre(end, sites.chest) - centre(end, waist)
    tilt = 1 - trunk[:, 2] / (trunk.norm(dim=-1) + 1e-6)
    free, far = ROUND_GOAL
    left = (wish.goal - way[:, :2]).norm(dim=-1)
    lingers = (1 - wish.speed / LINGERS).clamp(min=0) * (left < far)

    soles = take(torch.cat([last[:, None], future], 1), sites.left_sole + sites.right_sole)
    speed = torch.diff(soles, dim=1)[..., :2].norm(dim=-1) * FPS
    height = soles[:, 1:, :, 2]
    speed, height = speed.unflatten(-1, (2, -1)), height.unflatten(-1, (2, -1))
    on_floor = torch.exp(-((height.clamp(min=0) / NEAR_FLOOR) ** 2))
    short, narrow = _steps(soles[:, 1:].unflatten(-2, (2, -1)), on_floor.detach(), wish)
    # a walker lifts its feet anyway: they should rest, not leave the floor earlier
    on_floor = torch.where(wish.walks[:, None, None, None], on_floor.detach(), on_floor)
    lowest = height.argmin(-1, keepdim=True)
    rolling = (speed * on_floor).gather(-1, lowest).mean((-1, -2, -3))
    pivoting = (speed * on_floor).mean((-1, -2, -3))  # a foot may turn about one of its points
    floating = (height.amin((-1, -2)) - FLOATING).clamp(min=0).mean(-1)
    sinking = (-height).clamp(min=0).amax(-1).mean((-1, -2))
    raised = take(future, waist)[..., 2].mean((-1, -2)) / wish.waist_up
    squat = (torch.where(wish.stands, STRAIGHT, BENT) - raised).clamp(min=0)
    ankles = landed[:, [sites.left_ankle, sites.right_ankle]]
    stride = ((ankles[:, 0, :2] - ankles[:, 1, :2]) * facing).sum(-1).abs()
    seam = ((future[:, 0] - last) - (last - seed[:, 0])).norm(dim=-1).mean(-1) * FPS
    return Costs(
        way=(way[:, :2] - wish.asked.ways[:, 0]) / STEP_SECONDS,
        facing=1 - (facing * asked_facing).sum(-1),
        faced=(facing - asked_facing).norm(dim=-1).clamp(max=FACED) * wish.headed,
        lingers=lingers * (left - free).clamp(min=0),
        slide=rolling + 0.5 * pivoting,
        floating=floating + sinking,
        upright=(tilt - LEANING).clamp(min=0),
        squat=squat,
        apart=(stride - BESIDE).clamp(min=0) * wish.stands,
        short=short,
        narrow=narrow,
        seam=seam,
    )


def _steps(soles: Tensor, on_floor: Tensor, wish: Wish) -> tuple[Tensor, Tensor]:
    """Metres by which steps are too short [A], and too narrow [A], while both feet rest.

    `soles` [A, F, 2, 4, 3]: heel, ball (two) and toe, left before right. `on_floor` [A, F, 2, 4].
    The foot behind is measured at its ball, since its heel swings out while it pushes off. Steps
    are measured along the way to the goal, since hips turn and sway with each step.
    """
    distance = wish.goal.norm(dim=-1, keepdim=True)
    way = wish.goal / distance.clamp(min=1e-3)
    left = torch.stack([-way[:, 1], way[:, 0]], -1)
    heel, ball = soles[..., 0, :2], soles[..., 1:3, :2].mean(-2)  # [A, F, 2, 2]
    front = (heel.detach() * way[:, None, None]).sum(-1).argmax(-1, keepdim=True)
    before, behind = (
        points.gather(-2, which[..., None].expand(-1, -1, -1, 2))[..., 0, :]
        for points, which in ((heel, front), (ball, 1 - front))
    )
    foot = (ball - heel).norm(dim=-1).mean(-1).detach()
    step = ((before - behind) * way[:, None]).sum(-1) + foot
    side = ((before - behind) * left[:, None]).sum(-1) * (1.0 - 2.0 * front[..., 0])
    rests = on_floor[..., 0].gather(-1, front) * on_floor[..., 1:3].mean(-1).gather(-1, 1 - front)
    counts = rests[..., 0] * (step.detach() > ABREAST)
    counts = counts * (wish.walks & (distance[:, 0] > LAST_STEPS))[:, None]
    base, more = STEP
    least = (base + more * wish.speed) * wish.waist_up / LEGS
    short = (counts * (least[:, None] - step).clamp(min=0)).mean(-1)
    narrow = (counts * (WIDE - side).clamp(min=0)).mean(-1) * wish.straight
    return short, narrow
