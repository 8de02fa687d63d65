from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from wayfarer.errors import InvalidArgument
from wayfarer.navigation.examples import cubes_field, two_storeys
from wayfarer.navigation.picture import top_view
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Box


def pixels(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(png)).convert("RGB")).astype(int)


def test_the_picture_shows_ground_obstacles_and_paths() -> None:
    scene = bake(cubes_field(1))
    plain = pixels(top_view(scene, pixels=300))
    assert max(plain.shape[:2]) in range(296, 306)
    red, green, blue = np.moveaxis(plain, -1, 0)
    share = ((green > red) & (green > blue)).mean()
    assert share == pytest.approx(scene.area / (20 / 0.96) ** 2, abs=0.03)
    crate = scene.put("crate", Box((10.0, 10.0), (2.0, 2.0), 1.0))
    assert (pixels(top_view(crate, pixels=300)) != plain).any()
    walked = pixels(top_view(scene, [scene.path((1.0, 1.0), (19.0, 19.0))], pixels=300))
    changed = np.argwhere((walked != plain).any(-1))
    assert changed[:, 0].min() < 40 and changed[:, 0].max() > 260  # y points up, the path crosses


def test_storeys_are_drawn() -> None:
    assert (
        len(np.unique(pixels(top_view(bake(two_storeys()), pixels=200)).reshape(-1, 3), axis=0)) > 8
    )


@pytest.mark.parametrize("size", [0, 63, 100_000])
def test_the_size_is_bounded(size: int) -> None:
    with pytest.raises(InvalidArgument, match="64 to 2048"):
        top_view(bake(cubes_field(1, boxes=1)), pixels=size)
