"""The report's picture: how wrong joints are, and which speeds and turns the data cover."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")  # files only: no display, no toolkit
import matplotlib.pyplot as plt
import numpy as np

from wayfarer.spec import FPS
from wayfarer_lab.training.mocap.fitting import Fits
from wayfarer_lab.training.mocap.rig import JOINT_NAMES
from wayfarer_lab.training.mocap.selection import Use, smoothed
from wayfarer_lab.training.mocap.skeleton import Array
from wayfarer_lab.training.mocap.store import Dataset, atomically


def draw(folder: Path, dataset: Dataset, fits: list[Fits]) -> None:
    """Writes `report.png`: joint error before and after, the speeds and turns of training."""
    figure, (errors, covered) = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    known = ~np.isnan(fits[0].fitted.joint_error[0])
    names = [n for n, k in zip(JOINT_NAMES, known, strict=True) if k]
    for shift, stage in ((-0.2, "copied"), (0.2, "fitted")):
        values = np.concatenate([getattr(f, stage).joint_error for f in fits])[:, known]
        errors.barh(np.arange(len(names)) + shift, 100 * values.mean(0), 0.4, label=stage)
    errors.set(yticks=range(len(names)), yticklabels=names, title="mean joint error, cm")
    errors.legend()
    speed, yaw = coverage(dataset)
    bins = [np.linspace(0, 4, 41), np.linspace(-2.5, 2.5, 41)]
    covered.hist2d(speed, yaw, bins=bins, cmin=1, norm="log")
    covered.set(title="training", xlabel="speed, m/s", ylabel="turning, rad/s (left positive)")
    atomically(folder / "report.png", lambda path: figure.savefig(path, dpi=100))
    plt.close(figure)


def coverage(dataset: Dataset) -> tuple[Array, Array]:
    """Horizontal speed and yaw rate of the hips in the used train frames, smoothed over 0.4 s."""
    speeds, yaws = [np.zeros(0)], [np.zeros(0)]
    for clip in dataset.clips:
        if clip.split != "train":
            continue
        rows = slice(clip.start, clip.stop)
        x, y, z, w = dataset.rotations[rows, 0].astype(np.float64).T
        heading = np.unwrap(np.arctan2(-2 * (x * y - z * w), 1 - 2 * (x * x + z * z)))
        velocity = np.gradient(smoothed(dataset.translation[rows, :2], 17), axis=0) * FPS
        used = dataset.use[rows] != Use.EXCLUDED
        speeds.append(np.linalg.norm(velocity, axis=-1)[used])
        yaws.append((np.gradient(smoothed(heading, 17)) * FPS)[used])
    return np.concatenate(speeds), np.concatenate(yaws)
