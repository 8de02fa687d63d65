import numpy as np
import pytest

from wayfarer_lab.evaluation.pictures.raster import Canvas, cover

RED, GREEN = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])


def square(depth, half=10.0, middle=20.0):
    """Two triangles that show their front, as `Camera.project` gives them."""
    corners = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * half + middle
    seen = np.concatenate([corners, np.full((4, 1), float(depth))], -1)
    return seen, np.array([[0, 1, 2], [0, 2, 3]])


def draw(canvas, seen, faces, light):
    canvas.draw(seen, faces, np.tile(light, (len(seen), 1)))


def test_a_square_covers_its_pixels_and_no_other():
    canvas = Canvas((40, 40), smooth=1)
    draw(canvas, *square(1), RED)
    light, covered = canvas.layer()
    expected = np.zeros((40, 40))
    expected[10:30, 10:30] = 1
    assert (covered == expected).all()
    np.testing.assert_allclose(light[..., 0], expected, atol=1e-6)
    assert (light[..., 1:] == 0).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_one_is_seen_whatever_the_order(order):
    canvas = Canvas((40, 40), smooth=1)
    things = [(*square(2), RED), (*square(1, half=5), GREEN)]
    for index in order:
        draw(canvas, *things[index])
    light, _ = canvas.layer()
    assert light[20, 20].tolist() == pytest.approx([0, 1, 0])
    assert light[12, 12].tolist() == pytest.approx([1, 0, 0])


def test_a_mesh_beyond_the_picture_is_cut_off():
    canvas = Canvas((40, 40), smooth=1)
    draw(canvas, *square(1, half=500), RED)
    assert (canvas.layer()[1] == 1).all()
    outside = Canvas((40, 40), smooth=1)
    draw(outside, *square(1, middle=200), RED)
    assert (outside.layer()[1] == 0).all()


@pytest.mark.parametrize("depth", [-1.0, 0.0])
def test_what_is_behind_the_camera_is_not_drawn(depth):
    canvas = Canvas((40, 40))
    draw(canvas, *square(depth), RED)
    assert (canvas.layer()[1] == 0).all()


def test_backs_are_not_drawn():
    seen, faces = square(1)
    canvas = Canvas((40, 40))
    draw(canvas, seen, faces[:, ::-1], RED)
    assert (canvas.layer()[1] == 0).all()


def test_edges_within_a_pixel_cover_it_in_part():
    canvas = Canvas((40, 40), smooth=2)
    draw(canvas, *square(1, half=9.5), RED)
    _, covered = canvas.layer()
    assert covered[20, 10] == 0.5 and covered[10, 10] == 0.25 and covered[20, 20] == 1


def test_weights_blend_the_corners_and_flat_triangles_have_no_pixels():
    corners = np.array([[[0, 0], [0, 8], [8, 0]], [[1, 1], [4, 4], [8, 8]]], float)
    found = cover(corners, (8, 8))
    assert set(found.face.tolist()) == {0}
    np.testing.assert_allclose(found.weights.sum(-1), 1, atol=1e-6)
    place = np.einsum("pk,pkc->pc", found.weights, corners[found.face])
    expected = np.stack([found.pixel % 8, found.pixel // 8], -1) + 0.5
    np.testing.assert_allclose(place, expected, atol=1e-4)
