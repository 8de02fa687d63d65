import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfarer.navigation.grid import Grid
from wayfarer.navigation.sampling import bilinear


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.07, 0.5))
def test_filling_is_asking_for_every_cell(seed: int, cell: float) -> None:
    random = np.random.default_rng(seed)
    shapes = shapely.points(random.uniform(0, 5, (4, 2))).tolist()
    area = shapely.union_all([s.buffer(random.uniform(0.3, 1.5)) for s in shapes])
    area = area.difference(shapely.Point(2.5, 2.5).buffer(0.6))
    grid = Grid.over(area.bounds, cell, 0.3)
    x, y = np.meshgrid(*grid.middles())
    np.testing.assert_array_equal(grid.fill(area), shapely.contains_xy(area, x, y))


def test_what_lies_outside_of_the_grid_is_filled_as_far_as_it_is_seen() -> None:
    grid = Grid((0.0, 0.0), 1.0, 3, 4)
    assert grid.fill(shapely.box(-9, -9, 9, 9)).all()
    assert not grid.fill(shapely.box(10, 10, 12, 12)).any()


def test_a_window_is_the_part_that_covers_bounds() -> None:
    grid = Grid((0.0, 0.0), 0.5, 20, 30)
    window = grid.window((2.0, 3.0, 4.0, 5.0), 0.5)
    part = grid.part(window)
    assert part.origin[0] <= 1.5 and part.origin[1] <= 2.5
    assert part.origin[0] + part.columns * 0.5 >= 4.5
    x, _ = grid.middles()
    np.testing.assert_allclose(part.middles()[0], x[window[1]])


def test_bilinear_is_exact_for_planes_and_constant_beyond() -> None:
    values = np.float32(np.add.outer(2.0 * np.arange(5), 3.0 * np.arange(6)))  # [row, column]
    places = np.random.default_rng(0).uniform(0, 4, (50, 2))
    np.testing.assert_allclose(bilinear(values, places), 3 * places[:, 0] + 2 * places[:, 1])
    assert bilinear(values, np.array([-5.0, -5.0])) == 0
    assert bilinear(values, np.array([99.0, 99.0])) == values[-1, -1]
    assert np.isnan(bilinear(values, np.array([np.nan, 1.0])))
