import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.navigation.clearance import REACH, clearance_field
from wayfarer.navigation.grid import Grid
from wayfarer.navigation.scene_spec import Box
from wayfarer.navigation.solids import footprint

CELL = 0.1
FLOOR = shapely.box(0, 0, 8, 6)
boxes = st.lists(
    st.builds(
        Box,
        center=st.tuples(st.floats(0, 8), st.floats(0, 6)),
        size=st.tuples(st.floats(0.3, 2.5), st.floats(0.3, 2.5)),
        height=st.just(1.0),
        yaw=st.floats(0, 3.2),
    ),
    max_size=5,
)


def ground_of(solids: list[Box]) -> shapely.Geometry:
    return FLOOR.difference(shapely.union_all([footprint(box) for box in solids]))


def true_distance(ground: shapely.Geometry, points: np.ndarray) -> np.ndarray:
    spots = shapely.points(points)
    distance = np.minimum(shapely.distance(spots, shapely.boundary(ground)), REACH)
    return np.where(shapely.contains_xy(ground, points), distance, -distance)


@settings(max_examples=40, deadline=None)
@given(boxes)
def test_the_field_is_the_distance_to_the_nearest_wall(solids: list[Box]) -> None:
    ground = ground_of(solids)
    field = clearance_field(ground, Grid.over(FLOOR.bounds, CELL, 1.0))
    points = np.random.default_rng(1).uniform((-1, -1), (9, 7), (400, 2))
    wrong = np.abs(field.at(points) - true_distance(ground, points))
    assert wrong.max() < 1.1 * CELL
    assert np.quantile(wrong, 0.9) < 0.35 * CELL


@settings(max_examples=40, deadline=None)
@given(boxes, boxes)
def test_a_local_change_is_the_field_made_anew(before: list[Box], more: list[Box]) -> None:
    grid = Grid.over(FLOOR.bounds, CELL, 1.0)
    field = clearance_field(ground_of(before), grid)
    ground = ground_of(before + more)
    if more:
        where = tuple(shapely.total_bounds([footprint(box) for box in more]))
        field = field.changed(ground, where)
    anew = clearance_field(ground, grid)
    assert np.abs(field.distance - anew.distance).max() < CELL


def test_the_direction_leads_away_from_the_wall() -> None:
    field = clearance_field(FLOOR, Grid.over(FLOOR.bounds, CELL, 1.0))
    distance, away = field.sample(np.array([[0.5, 3.0], [4.0, 5.6], [-0.4, 3.0], [99.0, 99.0]]))
    np.testing.assert_allclose(distance[:3], [0.5, 0.4, -0.4], atol=1e-3)
    np.testing.assert_allclose(away[:3], [[1, 0], [0, -1], [1, 0]], atol=1e-3)
    assert distance[3] < 0 and np.isfinite(away).all()


def test_batches_of_any_shape_are_sampled() -> None:
    field = clearance_field(FLOOR, Grid.over(FLOOR.bounds, CELL, 1.0))
    points = np.random.default_rng(0).uniform(0, 6, (5, 7, 2))
    distance, away = field.sample(points)
    assert distance.shape == (5, 7) and away.shape == (5, 7, 2)
    np.testing.assert_array_equal(distance[3, 4], field.at(points[3, 4]))
