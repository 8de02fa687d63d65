import numpy as np
import pytest

from wayfarer.evaluation.raster import Camera, Canvas

CAMERA = Camera(
    right=np.array([1.0, 0, 0]), up=np.array([0, 0, 1.0]), centre=np.zeros(3), pixels_per_metre=10
)  # looks along +Y: the viewer is at -Y
RED, GREEN = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])


def square(y, half=1.0):
    """A square facing the viewer, at depth y."""
    corners = [[-half, y, -half], [half, y, -half], [half, y, half], [-half, y, half]]
    return np.array(corners), np.array([[0, 1, 2], [0, 2, 3]])


def draw(canvas, vertices, faces, colour):
    canvas.draw_mesh(CAMERA, vertices, faces, np.tile(colour, (len(vertices), 1)))


def test_a_square_covers_its_pixels_and_no_other():
    canvas = Canvas(40, 40, np.ones(3))
    draw(canvas, *square(0), RED)
    covered = (canvas.pixels != 1).any(-1)
    expected = np.zeros((40, 40), bool)
    expected[10:30, 10:30] = True
    assert (covered == expected).all()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_one_is_seen_whatever_the_order(order):
    canvas = Canvas(40, 40, np.ones(3))
    things = [(*square(1.0), RED), (*square(-1.0, half=0.5), GREEN)]
    for index in order:
        draw(canvas, *things[index])
    middle, rim = canvas.pixels[20, 20], canvas.pixels[12, 12]
    assert middle[1] > 0 and middle[0] == 0
    assert rim[0] > 0 and rim[1] == 0


def test_a_mesh_beyond_the_picture_is_cut_off():
    canvas = Canvas(40, 40, np.ones(3))
    draw(canvas, *square(0, half=50.0), RED)
    assert (canvas.pixels[..., 1] == 0).all()
    outside = Canvas(40, 40, np.ones(3))
    vertices, faces = square(0)
    draw(outside, vertices + np.array([100.0, 0, 0]), faces, RED)
    assert (outside.pixels == 1).all()


def test_supersampling_averages():
    canvas = Canvas(4, 2, np.zeros(3))
    canvas.pixels[0, 0] = 1
    image = canvas.image(2)
    assert image.shape == (1, 2, 3)
    assert image[0, 0].tolist() == [64, 64, 64]
    assert image[0, 1].tolist() == [0, 0, 0]
