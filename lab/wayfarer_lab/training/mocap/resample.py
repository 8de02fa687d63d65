"""Change of frame rate, before anything is cut."""

import numpy as np

from wayfarer_lab.training.mocap.skeleton import Array


def nearest_rotations(matrices: Array) -> Array:
    """Closest rotation of each 3×3 matrix (polar decomposition). [..., 3, 3]."""
    u, _, vt = np.linalg.svd(matrices)
    u[..., 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return u @ vt


def _smooth(values: Array, width: int) -> Array:
    """Triangular average over 2·width - 1 frames: takes away what the lower rate cannot hold."""
    kernel = np.bartlett(2 * width + 1)[1:-1]
    padded = np.concatenate([values[:1]] * (width - 1) + [values] + [values[-1:]] * (width - 1))
    total = sum(
        (k * padded[i : i + len(values)] for i, k in enumerate(kernel)), np.zeros_like(values)
    )
    return total / kernel.sum()


def resample(places: Array, rotations: Array, fps: float, target: float) -> tuple[Array, Array]:
    """Places [N, J, 3] and rotations [N, J, 3, 3] at `target` frames per second.

    A higher rate is smoothed first over the new frame interval (no aliasing); a rate that is
    no multiple is interpolated by cubic splines, which keep velocities smooth between frames.
    """
    ratio = fps / target
    whole = round(ratio)
    if abs(ratio - 1) < 1e-3:
        return places, rotations
    if ratio >= 1.5:
        places, rotations = _smooth(places, whole), _smooth(rotations, whole)
    if abs(ratio - whole) < 1e-2:
        return places[::whole], nearest_rotations(rotations[::whole])
    # imported here: scipy comes with the `train` extra
    from scipy.interpolate import CubicSpline

    given = np.arange(len(places))
    times = np.arange(0, len(places) - 1 + 1e-9, ratio)
    return CubicSpline(given, places)(times), nearest_rotations(
        CubicSpline(given, rotations)(times)
    )
