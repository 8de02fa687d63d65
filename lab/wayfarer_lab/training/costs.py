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


class Costs(NamedTuple):
    """Deviations of a step [A]; units as of the config's weights."""

    way: Tensor
    facing: Tensor
    slide: Tensor
    floating: Tensor
    upright: Tensor
    squat: Tensor
    apart: Tensor
    seam: Tensor


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
    asked: Asked,
    sites: Sites,
    waist_up: Tensor,
    stands: Tensor,
    walks: Tensor,
) -> Costs:
    """Costs of markers: seed [A, S, 67, 3], future [A, F, 67, 3], and the last ones with feet where
    they are locked, landed [A, 67, 3]; canonical frame.

    `waist_up` [A] are heights from `waist_height`; agents of `stands` [A] are asked to stand,
    those of `walks` [A] to go ahead, and not slowly.
    """
    last, end = seed[:, -1], future[:, -1]
    waist = sites.left_waist + sites.right_waist

    def centre(markers: Tensor, which: list[int]) -> Tensor:
        return take(markers, which).mean(-2)

    way = centre(end, waist) - centre(last, waist)
    across = (centre(end, sites.right_waist) - centre(end, sites.left_waist))[:, :2]
    across = across / (across.norm(dim=-1, keepdim=True) + 1e-6)
    facing = torch.stack([-across[:, 1], across[:, 0]], -1)
    trunk = centre(end, sites.chest) - centre(end, waist)
    tilt = 1 - trunk[:, 2] / (trunk.norm(dim=-1) + 1e-6)

    soles = take(torch.cat([last[:, None], future], 1), sites.left_sole + sites.right_sole)
    speed = torch.diff(soles, dim=1)[..., :2].norm(dim=-1) * FPS
    height = soles[:, 1:, :, 2]
    speed, height = speed.unflatten(-1, (2, -1)), height.unflatten(-1, (2, -1))
    on_floor = torch.exp(-((height.clamp(min=0) / NEAR_FLOOR) ** 2))
    # a walker lifts its feet anyway: they should rest, not leave the floor earlier
    on_floor = torch.where(walks[:, None, None, None], on_floor.detach(), on_floor)
    lowest = height.argmin(-1, keepdim=True)
    rolling = (speed * on_floor).gather(-1, lowest).mean((-1, -2, -3))
    pivoting = (speed * on_floor).mean((-1, -2, -3))  # a foot may turn about one of its points
    floating = (height.amin((-1, -2)) - FLOATING).clamp(min=0).mean(-1)
    sinking = (-height).clamp(min=0).amax(-1).mean((-1, -2))
    raised = take(future, waist)[..., 2].mean((-1, -2)) / waist_up
    squat = (torch.where(stands, STRAIGHT, BENT) - raised).clamp(min=0)
    ankles = landed[:, [sites.left_ankle, sites.right_ankle]]
    stride = ((ankles[:, 0, :2] - ankles[:, 1, :2]) * facing).sum(-1).abs()
    seam = ((future[:, 0] - last) - (last - seed[:, 0])).norm(dim=-1).mean(-1) * FPS
    return Costs(
        way=(way[:, :2] - asked.ways[:, 0]).norm(dim=-1) / STEP_SECONDS,
        facing=1 - (facing * asked.facings[:, 0]).sum(-1),
        slide=rolling + 0.5 * pivoting,
        floating=floating + sinking,
        upright=(tilt - LEANING).clamp(min=0),
        squat=squat,
        apart=(stride - BESIDE).clamp(min=0) * stands,
        seam=seam,
    )
