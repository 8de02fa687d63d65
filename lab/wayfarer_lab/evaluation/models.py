"""Tables of the trained networks on recorded motion: predictors (Tab. S1), regressors (Tab. S2)."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from wayfarer.body.model import BodyModel
from wayfarer.engines.torch.marker_bodies import load_marker_bodies
from wayfarer.errors import InvalidArgument
from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.motion.marker_body import MarkerBody
from wayfarer.motion.predictor import MarkerPredictor
from wayfarer.motion.primitive import EVERY
from wayfarer.motion.regressor import BodyRegressor
from wayfarer.spec import BETAS, GENDERS, LATENT, PRIMITIVE_FRAMES, SEED_FRAMES
from wayfarer_lab.evaluation.gait import Row
from wayfarer_lab.evaluation.metrics import prediction
from wayfarer_lab.evaluation.model_parts import Parts
from wayfarer_lab.evaluation.tracks import Recorded
from wayfarer_lab.training.rotation import matrix_from_quaternion

Array = NDArray[np.floating[Any]]

ALIKE_SEEDS: Final = 0.5
"""ε of MMADE and MMFDE, metres over all markers of the last seed frame together."""

MESH_FRAMES: Final = 100
"""Frames whose whole mesh is compared for AVD."""

BLOCK: Final = 256
"""Rows computed at once: bounds memory."""

MEMORY: Final = 10_000
"""Recorded primitives per gender in which the row "mocap" searches for similar seeds."""


@dataclass(frozen=True)
class Primitives:
    """Recorded primitives of one gender: W windows of F = 10 frames, world space."""

    translation: Tensor  # [W, F, 3]
    rotations: Tensor  # [W, F, 22, 3, 3] joint 0 world, others local
    betas: Tensor  # [W, 10]

    def markers(self, body: MarkerBody) -> Tensor:
        """Markers [W, F, 67, 3] of these poses, world."""
        shape = body.shaped(self.betas)
        return body.skin(shape, self.translation, self.rotations)[0]

    def canonical(self, floor_origin: bool = True) -> "Primitives":
        """The same motion, each window in its canonical frame."""
        frame = canonical_frame(self.translation[:, 0], self.rotations[:, 0, 0], floor_origin)
        root = frame.rotation.transpose(-1, -2)[:, None] @ self.rotations[:, :, 0]
        rotations = torch.cat([root[:, :, None], self.rotations[:, :, 1:]], 2)
        return Primitives(to_local(frame, self.translation), rotations, self.betas)

    def regressed(self) -> "Primitives":
        """The frames that a step regresses: the last of the seed, and some of the new ones."""
        some = slice(SEED_FRAMES - 1, None, EVERY)
        return Primitives(self.translation[:, some], self.rotations[:, some], self.betas)


def primitives(recorded: Recorded, gender: str, count: int, seed: int) -> Primitives:
    """At most `count` random windows in use. Raises InvalidArgument when there are none."""
    data, starts, shapes = recorded.data, [], []
    allowed = data.windows(PRIMITIVE_FRAMES)
    for clip in recorded.clips:
        if clip.gender == gender:
            inside = allowed[(allowed >= clip.start) & (allowed < clip.stop)]
            starts.append(inside)
            shapes.append(np.tile(np.asarray(clip.betas, np.float32), (len(inside), 1)))
    if not sum(map(len, starts)):
        raise InvalidArgument(f"no primitives of {gender} bodies in use among these clips")
    chosen = np.concatenate(starts)
    order = np.random.default_rng(seed).permutation(len(chosen))[:count]
    index = chosen[order][:, None] + np.arange(PRIMITIVE_FRAMES)
    return Primitives(
        translation=torch.from_numpy(data.translation[index]),
        rotations=matrix_from_quaternion(torch.from_numpy(data.rotations[index])),
        betas=torch.from_numpy(np.concatenate(shapes)[order]),
    )


@torch.inference_mode()
def predictor_rows(
    parts: Parts,
    recorded: Recorded,
    samples: int,
    count: int,
    seed: int,
    memory: Recorded | None = None,
) -> list[Row]:
    """Every predictor; as baselines the last frame, a straight line, and recordings.

    Distances are L2 of whole poses (201 coordinates) in the canonical frame of the seed. *One
    sample*: K = 1. The row **mocap** is a nearest-neighbour predictor: the futures of the K =
    `samples` primitives of `memory` (the train split) with the nearest 2-frame seeds.

    Figures:
        primitives: number of recorded primitives
        samples: K, futures drawn for each
        ade_m: the best of K futures by its mean over frames
        fde_m: the best of K futures by its last frame
        mmade_m: `ade_m`, mean over every true future whose last seed frame is within 0.5 m
        mmfde_m: `fde_m`, mean over the same
        apd_m: mean pairwise L2 of the K futures, flattened over frames too (the paper's
            *diversity*)
    """
    if not parts.predictors:
        raise InvalidArgument("these models hold no predictor_1f.onnx or predictor_2f.onnx")
    windows = _windows(recorded, count, seed, parts.floor_origin)
    noise = np.random.default_rng(seed).standard_normal((len(windows), samples, LATENT))
    latents = torch.from_numpy(noise.astype(np.float32))
    rows: list[Row] = []
    for name, predictor in parts.predictors.items():
        past, future = windows[:, : predictor.seed_frames], windows[:, predictor.seed_frames :]
        made = _decode(predictor, past, latents)
        rows.append(_errors(name, made, past, future))
        rows.append(_errors(f"{name}, one sample", made[:, :1], past, future))
    past, future = windows[:, :2], windows[:, 2:]
    steps = np.arange(1, future.shape[1] + 1, dtype=np.float32)[:, None]
    still = np.repeat(past[:, None, 1:], future.shape[1], 2)
    line = past[:, None, 1:] + steps * (past[:, 1:] - past[:, :1])[:, None]
    rows.append(_errors("repeat last frame", still, past, future))
    rows.append(_errors("straight line", line, past, future))
    if memory is not None:
        known = _windows(memory, MEMORY, seed, parts.floor_origin)
        made = known[_nearest(past, known[:, :2], samples), 2:]
        rows.append(_errors("mocap", made, past, future))
    return rows


@torch.inference_mode()
def regressor_rows(parts: Parts, recorded: Recorded, count: int, seed: int) -> list[Row]:
    """Each gender's regressor on recorded poses: with the recorded shapes and with random ones.

    A step's frames are used. The row **mocap** puts the recordings' own parameters in
    a regressor's place: the floor of these figures, 0 except for rounding.

    Figures:
        frames: number of frames
        amd_mm: mean distance of markers
        amd_p95_mm: 95th percentile of the distance of markers
        avd_mm: mean distance of mesh vertices (100 frames)
        joint_angle_deg: mean angle between joint rotations
    """
    bodies = load_marker_bodies()
    present = sorted({clip.gender for clip in recorded.clips})
    known = {gender: primitives(recorded, gender, count, seed) for gender in present}
    rows: list[Row] = []
    for gender in GENDERS:
        cases = {"recorded shapes": [known[gender]]} if gender in known else {}
        # a recorded shape belongs to its gender, a pose fits any body
        cases["random shapes"] = [_reshape(poses, seed) for poses in known.values()]
        for name, parts_of in cases.items():
            poses = _join(parts_of).canonical().regressed()
            made = _regressed(parts.regressors[gender], poses, bodies[gender])
            body = recorded.bodies[gender]
            rows.append(differences(f"{gender}, {name}", made, poses, body, bodies[gender]))
    gender = present[0]
    truth = known[gender].canonical().regressed()
    rows.append(differences("mocap", truth, truth, recorded.bodies[gender], bodies[gender]))
    return rows


def _join(poses: list[Primitives]) -> Primitives:
    return Primitives(
        torch.cat([p.translation for p in poses]),
        torch.cat([p.rotations for p in poses]),
        torch.cat([p.betas for p in poses]),
    )


def _reshape(poses: Primitives, seed: int) -> Primitives:
    """The same poses with shapes drawn from the shape space, within 2.5 standard deviations."""
    betas = np.random.default_rng(seed).standard_normal((len(poses.betas), BETAS)).clip(-2.5, 2.5)
    return Primitives(poses.translation, poses.rotations, torch.from_numpy(np.float32(betas)))


def _regressed(regressor: BodyRegressor, poses: Primitives, body: MarkerBody) -> Primitives:
    """The regressor's solution for the markers of canonical `poses`."""
    place, rotations = zip(
        *(
            regressor(markers, betas)
            for markers, betas in zip(
                poses.markers(body).split(BLOCK), poses.betas.split(BLOCK), strict=True
            )
        ),
        strict=True,
    )
    return Primitives(torch.cat(place), torch.cat(rotations), poses.betas)


def differences(
    name: str, made: Primitives, truth: Primitives, body: BodyModel, marker_body: MarkerBody
) -> Row:
    """AMD, AVD and the mean angle between joint rotations (the hips' own left out)."""
    markers, guess = truth.markers(marker_body), made.markers(marker_body)
    error = 1000 * (guess - markers).norm(dim=-1)
    relative = truth.rotations[:, :, 1:].transpose(-1, -2) @ made.rotations[:, :, 1:]
    # |R - 1|² = 8 sin²(angle / 2): unlike the arc cosine of the trace, exact for small angles
    chord = (relative - torch.eye(3)).flatten(-2).norm(dim=-1) / 8**0.5
    return {
        "name": name,
        "frames": error[..., 0].numel(),
        "amd_mm": float(error.mean()),
        "amd_p95_mm": float(np.percentile(error.numpy(), 95)),
        "avd_mm": _mesh_error(body, made, truth),
        "joint_angle_deg": float(torch.rad2deg(2 * torch.asin(chord.clamp(max=1))).mean()),
    }


def _mesh_error(body: BodyModel, made: Primitives, truth: Primitives) -> float:
    """AVD, mm, over the whole mesh of some frames spread over all."""
    frames = truth.translation.shape[1]
    errors = []
    for row in np.linspace(0, frames * len(truth.betas) - 1, MESH_FRAMES).astype(int):
        window, frame = divmod(int(row), frames)
        shape = truth.betas[window].numpy()
        rest = body.rest_joints(shape)
        true, guess = (
            body.skin(
                shape,
                *body.forward_kinematics(
                    poses.translation[window, frame].numpy(),
                    poses.rotations[window, frame].numpy(),
                    rest,
                ),
            )
            for poses in (truth, made)
        )
        errors.append(prediction.avd(guess, true))
    return float(np.mean(errors))


def _windows(recorded: Recorded, count: int, seed: int, floor_origin: bool) -> Array:
    """Flattened markers [W, F, 201] of both genders in canonical frames."""
    parts, bodies = [], load_marker_bodies()
    for gender in sorted({clip.gender for clip in recorded.clips}):
        poses = primitives(recorded, gender, count, seed).canonical(floor_origin)
        parts.append(poses.markers(bodies[gender]).flatten(-2).numpy())
    return np.concatenate(parts)


def _decode(predictor: MarkerPredictor, past: Array, latents: Tensor) -> Array:
    """Futures [W, K, F, 201] of seeds [W, S, 201] and latents [W, K, 128]."""
    seeds = torch.from_numpy(np.ascontiguousarray(past)).split(BLOCK)
    made = [predictor.decode(s, z) for s, z in zip(seeds, latents.split(BLOCK), strict=True)]
    return torch.cat(made).numpy()


def _nearest(seeds: Array, known: Array, count: int) -> NDArray[np.int64]:
    """Indices [W, K] of the `count` of `known` [N, S, 201] nearest to each of seeds [W, S, 201]."""
    points = torch.from_numpy(known.reshape(len(known), -1).copy())
    asked = torch.from_numpy(seeds.reshape(len(seeds), -1).copy()).split(BLOCK)
    best = [torch.cdist(block, points).topk(count, largest=False).indices for block in asked]
    return torch.cat(best).numpy()


def _errors(name: str, made: Array, past: Array, future: Array) -> Row:
    """Figures of futures `made` [W, K, F, 201], the best of K; seeds `past`, truth `future`."""
    multimodal = prediction.multimodal_errors(made, future, past[:, -1], ALIKE_SEEDS)
    return {
        "name": name,
        "primitives": len(future),
        "samples": made.shape[1],
        "ade_m": float(prediction.ade(made, future).mean()),
        "fde_m": float(prediction.fde(made, future).mean()),
        "mmade_m": multimodal[0],
        "mmfde_m": multimodal[1],
        "apd_m": float(prediction.apd(made).mean()) if made.shape[1] > 1 else 0.0,
    }
