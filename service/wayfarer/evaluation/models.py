"""Tables of the trained networks on recorded motion: predictor and regressors, as exported."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import torch
from numpy.typing import NDArray

from wayfarer.artifacts import open_session
from wayfarer.body.model import BodyModel
from wayfarer.body.rotation import matrix_from_quaternion
from wayfarer.errors import InvalidArgument
from wayfarer.evaluation import metrics
from wayfarer.evaluation.gait import Row
from wayfarer.evaluation.tracks import Recorded
from wayfarer.motion.frame import canonical_frame, to_local
from wayfarer.spec import BETAS, GENDERS, LATENT, PRIMITIVE_FRAMES

Array = NDArray[np.floating[Any]]

ALIKE_SEEDS = 0.5
"""ε of MMADE and MMFDE, metres over all markers of the last seed frame together."""

MESH_FRAMES = 100
"""Frames whose whole mesh is compared for AVD."""


@dataclass(frozen=True)
class Primitives:
    """Recorded primitives of one gender: W windows of F = 10 frames, world space."""

    translation: Array  # [W, F, 3]
    rotations: Array  # [W, F, 22, 3, 3] joint 0 world, others local
    betas: Array  # [W, 10]

    def markers(self, body: BodyModel, betas: Array) -> Array:
        """Markers [W, F, M, 3] of these poses on bodies of shape `betas` [W, 10]."""
        rows = []
        for place, rotation, shape in zip(self.translation, self.rotations, betas, strict=True):
            world, places = body.forward_kinematics(place, rotation, body.rest_joints(shape))
            rows.append(body.markers(shape, world, places))
        return np.stack(rows)

    def canonical(self, points: Array) -> Array:
        """Points [W, F, P, 3] in the canonical frame of each window's first frame."""
        hips, turn = (
            torch.from_numpy(self.translation[:, 0]),
            torch.from_numpy(self.rotations[:, 0, 0]),
        )
        frame = canonical_frame(hips, turn)
        flat = torch.from_numpy(points).flatten(1, 2)
        return to_local(frame, flat).reshape(points.shape).numpy().astype(np.float32)


def primitives(recorded: Recorded, gender: str, count: int, seed: int) -> Primitives:
    """At most `count` random windows in use. Raises InvalidArgument when there are none."""
    data, starts, shapes = recorded.data, [], []
    allowed = data.windows(PRIMITIVE_FRAMES)
    for clip in recorded.clips:
        if clip.gender == gender:
            inside = allowed[(allowed >= clip.start) & (allowed < clip.stop)]
            starts.append(inside)
            shapes.append(np.tile(clip.betas, (len(inside), 1)))
    if not sum(map(len, starts)):
        raise InvalidArgument(f"no primitives of {gender} bodies in use among these clips")
    chosen = np.concatenate(starts)
    order = np.random.default_rng(seed).permutation(len(chosen))[:count]
    index = chosen[order][:, None] + np.arange(PRIMITIVE_FRAMES)
    return Primitives(
        translation=data.translation[index].astype(np.float64),
        rotations=matrix_from_quaternion(data.rotations[index].astype(np.float64)),
        betas=np.concatenate(shapes)[order],
    )


def predictor_rows(
    models: Path, recorded: Recorded, samples: int, count: int, seed: int
) -> list[Row]:
    """The predictors in `models`, beside repeating the last frame and a straight line."""
    windows = _both_genders(recorded, count, seed)
    rows: list[Row] = []
    for seed_frames in (1, 2):
        path = models / f"predictor_{seed_frames}f.onnx"
        if not path.exists():
            continue
        past, future = windows[:, :seed_frames], windows[:, seed_frames:]
        noise = np.random.default_rng(seed).standard_normal((len(past), samples, LATENT))
        made = _decode(_open(path), past, noise.astype(np.float32))
        rows.append(_errors(f"{seed_frames}f, best of {samples}", made, past, future))
        rows.append(_errors(f"{seed_frames}f, one sample", made[:, :1], past, future))
    if not rows:
        raise InvalidArgument(f"{models} holds no predictor_1f.onnx or predictor_2f.onnx")
    past, future = windows[:, :2], windows[:, 2:]
    steps = np.arange(1, future.shape[1] + 1, dtype=np.float32)[:, None]
    still = np.repeat(past[:, None, 1:], future.shape[1], 2)
    line = past[:, None, 1:] + steps * (past[:, 1:] - past[:, :1])[:, None]
    rows.append(_errors("repeat last frame", still, past, future))
    rows.append(_errors("straight line", line, past, future))
    return rows


def regressor_rows(models: Path, recorded: Recorded, count: int, seed: int) -> list[Row]:
    """Each gender's regressor on recorded poses: with the recorded shapes and with random ones."""
    rows: list[Row] = []
    for gender in GENDERS:
        session, body = _open(models / f"regressor_{gender}.onnx"), recorded.bodies[gender]
        own = [c for c in recorded.clips if c.gender == gender]
        for name, known in (("recorded shapes", True), ("random shapes", False)):
            if known and not own:
                continue
            poses = [
                primitives(recorded, g, count, seed) for g in _genders(recorded, gender, known)
            ]
            poses = [p if known else _reshape(p, seed) for p in poses]
            rows.append(_regress(f"{gender}, {name}", session, body, poses))
    return rows


def _genders(recorded: Recorded, gender: str, known: bool) -> list[str]:
    """Whose poses are used: a recorded shape belongs to its gender, a pose fits any body."""
    present = {clip.gender for clip in recorded.clips}
    return [gender] if known else sorted(present)


def _reshape(poses: Primitives, seed: int) -> Primitives:
    """The same poses with shapes drawn from the shape space, within 2.5 standard deviations."""
    betas = np.random.default_rng(seed).standard_normal((len(poses.betas), BETAS)).clip(-2.5, 2.5)
    return Primitives(poses.translation, poses.rotations, betas)


def _regress(
    name: str,
    session: onnxruntime.InferenceSession,
    body: BodyModel,
    parts: list[Primitives],
) -> Row:
    truth = [p.markers(body, p.betas) for p in parts]
    local = np.concatenate([p.canonical(t) for p, t in zip(parts, truth, strict=True)])
    betas = np.concatenate([p.betas for p in parts])
    frames = local.shape[1]
    shapes = np.repeat(betas, frames, 0)
    markers = local.reshape(-1, *local.shape[2:])
    given = {
        "markers": markers.reshape(len(markers), -1),
        "betas": shapes.astype(np.float32),
    }
    place, turn = (
        np.asarray(out, np.float64) for out in session.run(["translation", "rotations"], given)
    )
    made = Primitives(place[:, None], turn[:, None], shapes)

    true_turn = np.concatenate([p.rotations for p in parts]).reshape(-1, *turn.shape[1:])
    relative = np.swapaxes(true_turn[:, 1:], -1, -2) @ turn[:, 1:]
    cosine = (np.trace(relative, axis1=-2, axis2=-1) - 1) / 2
    error = np.linalg.norm(made.markers(body, shapes)[:, 0] - markers, axis=-1) * 1000
    return {
        "name": name,
        "frames": len(markers),
        "amd_mm": float(error.mean()),
        "amd_p95_mm": float(np.percentile(error, 95)),
        "avd_mm": _mesh_error(body, parts[0], place, turn),
        "joint_angle_deg": float(np.degrees(np.arccos(cosine.clip(-1, 1))).mean()),
    }


def _mesh_error(body: BodyModel, poses: Primitives, place: Array, turn: Array) -> float:
    """AVD, mm, over the whole mesh of some frames spread over the first of the poses."""
    frames = poses.translation.shape[1]
    errors = []
    for row in np.linspace(0, frames * len(poses.betas) - 1, MESH_FRAMES).astype(int):
        window, frame = divmod(int(row), frames)
        shape = poses.betas[window]
        rest = body.rest_joints(shape)
        world = body.forward_kinematics(
            poses.translation[window, frame], poses.rotations[window, frame], rest
        )
        truth = body.skin(shape, *world)
        one = Primitives(poses.translation[[window]], poses.rotations[[window]], shape[None])
        local = one.canonical(truth[None, None])[0, 0]
        made = body.skin(shape, *body.forward_kinematics(place[row], turn[row], rest))
        errors.append(metrics.avd(made, local))
    return float(np.mean(errors))


def _both_genders(recorded: Recorded, count: int, seed: int) -> Array:
    """Flattened markers [W, F, 201] in canonical frames."""
    parts = []
    for gender in sorted({clip.gender for clip in recorded.clips}):
        poses = primitives(recorded, gender, count, seed)
        parts.append(poses.canonical(poses.markers(recorded.bodies[gender], poses.betas)))
    windows = np.concatenate(parts)
    return windows.reshape(*windows.shape[:2], -1)


def _decode(session: onnxruntime.InferenceSession, past: Array, noise: Array) -> Array:
    """Futures [W, K, F, 201] of seeds [W, S, 201] and latents [W, K, 128]."""
    made = [
        session.run(["future"], {"seed": past, "latent": np.ascontiguousarray(noise[:, k])})[0]
        for k in range(noise.shape[1])
    ]
    return np.stack(made, 1)


def _errors(name: str, made: Array, past: Array, future: Array) -> Row:
    multimodal = metrics.multimodal_errors(made, future, past[:, -1], ALIKE_SEEDS)
    return {
        "name": name,
        "primitives": len(future),
        "ade_m": float(metrics.ade(made, future).mean()),
        "fde_m": float(metrics.fde(made, future).mean()),
        "mmade_m": multimodal[0],
        "mmfde_m": multimodal[1],
        "apd_m": float(metrics.apd(made).mean()) if made.shape[1] > 1 else 0.0,
    }


def _open(path: Path) -> onnxruntime.InferenceSession:
    return open_session(path, onnxruntime.SessionOptions())
