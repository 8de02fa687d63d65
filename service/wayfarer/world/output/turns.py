"""Vectors and turns of one body at a time, for compiled rules; `quaternion.py` has them for arrays.

A vector is (x, y, z), a rotation the unit quaternion (x, y, z, w), both of Python floats.
"""

from math import sqrt

from wayfarer.process.compiled import inner
from wayfarer.world.rows import Double, Float

Vector = tuple[float, float, float]
Turn = tuple[float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]


@inner
def vector(values: Float | Double, at: tuple[int, ...]) -> Vector:
    """The vector of an array [..., 3] at an index. A slice would be allocated, and counted."""
    return float(values[(*at, 0)]), float(values[(*at, 1)]), float(values[(*at, 2)])


@inner
def turn(values: Float, at: tuple[int, ...]) -> Turn:
    """The rotation of an array [..., 4] at an index."""
    return (
        float(values[(*at, 0)]),
        float(values[(*at, 1)]),
        float(values[(*at, 2)]),
        float(values[(*at, 3)]),
    )


@inner
def put_vector(values: Float | Double, at: tuple[int, ...], made: Vector) -> None:
    """Writes a vector into an array [..., 3] at an index."""
    values[(*at, 0)], values[(*at, 1)], values[(*at, 2)] = made


@inner
def put(values: Float, at: tuple[int, ...], made: Turn) -> None:
    """Writes a rotation into an array [..., 4] at an index."""
    values[(*at, 0)], values[(*at, 1)], values[(*at, 2)], values[(*at, 3)] = made


@inner
def multiply(a: Turn, b: Turn) -> Turn:
    """The rotation by b, then by a."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
        a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@inner
def inverse(a: Turn) -> Turn:
    """The inverse rotation."""
    return -a[0], -a[1], -a[2], a[3]


@inner
def about(axis: Vector, sine: float, cosine: float) -> Turn:
    """The rotation about an axis, by half the angle's sine and cosine."""
    return sine * axis[0], sine * axis[1], sine * axis[2], cosine


@inner
def add(a: Vector, b: Vector) -> Vector:
    """Sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inner
def less(a: Vector, b: Vector) -> Vector:
    """The vector from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inner
def cross(a: Vector, b: Vector) -> Vector:
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def length(a: Vector) -> float:
    """Euclidean norm."""
    return sqrt(dot(a, a))


@inner
def matrix(a: Turn) -> Matrix:
    """The rows of its matrix, for rotating several vectors."""
    x2, y2, z2 = 2 * a[0], 2 * a[1], 2 * a[2]
    xx, yy, zz = a[0] * x2, a[1] * y2, a[2] * z2
    xy, xz, yz = a[0] * y2, a[0] * z2, a[1] * z2
    wx, wy, wz = a[3] * x2, a[3] * y2, a[3] * z2
    return (
        (1 - yy - zz, xy - wz, xz + wy),
        (xy + wz, 1 - xx - zz, yz - wx),
        (xz - wy, yz + wx, 1 - xx - yy),
    )


@inner
def turned(rows: Matrix, a: Vector) -> Vector:
    """A vector rotated by a matrix."""
    return dot(rows[0], a), dot(rows[1], a), dot(rows[2], a)


@inner
def rotate(by: Turn, a: Vector) -> Vector:
    """A vector rotated by a quaternion."""
    return turned(matrix(by), a)


@inner
def apart(a: Float, row: int, b: Float, other: int) -> float:
    """Distance of two points of arrays [N, 2], in the arrays' precision."""
    x, y = a[row, 0] - b[other, 0], a[row, 1] - b[other, 1]
    return sqrt(x * x + y * y)


@inner
def bounded(value: float, low: float, high: float) -> float:
    """The number clipped to a range."""
    return min(max(value, low), high)


@inner
def between(value: float, at: tuple[float, float], values: tuple[float, float]) -> float:
    """`values[0]` up to `at[0]`, `values[1]` from `at[1]` on, linear in between: as `np.interp`."""
    if value <= at[0]:
        return values[0]
    if value >= at[1]:
        return values[1]
    return (values[1] - values[0]) / (at[1] - at[0]) * (value - at[0]) + values[0]


@inner
def smooth(value: float, low: float, high: float) -> float:
    """0 below `low`, 1 above `high`, smooth between."""
    t = bounded((value - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)
