"""What each vertex wears, so that renders look dressed. Build time only.

The numbers are those of `body/outfit.py`: skin, hair, shirt, trousers, shoes, and eyes.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.outfit import EYES, HAIR, SHIRT, SHOES, SKIN, TROUSERS

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]


def find_regions(
    vertices: Array, owner: Index, names: Sequence[str], joints: Mapping[str, Array], eyes: Index
) -> NDArray[np.uint8]:
    """Region of each vertex, [V], of a T-posed mesh; `owner` is the joint that moves it most."""
    part = np.array(names)[owner]
    x, y, z = np.abs(vertices[:, 0]), vertices[:, 1], vertices[:, 2]
    region = np.full(len(vertices), SKIN, dtype=np.uint8)

    def owned(*suffixes: str) -> NDArray[np.bool_]:
        return np.array([any(name.endswith(s) for s in suffixes) for name in names])[owner]

    waist = joints["spine1"][2] + 0.02
    trunk = owned("pelvis", "hip", "spine1", "spine2", "spine3", "collar", "shoulder", "neck")
    sleeve = np.abs(joints["left_shoulder"][0] * 0.45 + joints["left_elbow"][0] * 0.55)
    collar = joints["neck"][2] - 0.01 - 0.55 * np.clip(y - joints["neck"][1], 0, 0.2)
    region[trunk & (z >= waist) & (x <= sleeve) & (z <= np.maximum(collar, 0) + 0.4 * x)] = SHIRT
    region[owned("pelvis", "hip", "knee", "spine1", "spine2") & (z < waist)] = TROUSERS
    ankle = joints["left_ankle"][2]
    region[owned("knee", "ankle", "foot") & (z < ankle + 0.015)] = SHOES

    head = joints["head"]
    top = vertices[part == "head", 2].max()
    nape = head[2] + 0.01
    # The hairline runs from the forehead down in front of the ears to the nape.
    front = vertices[part == "head", 1].max()
    back = vertices[part == "head", 1].min()
    share = (y - back) / (front - back)
    heights = [nape, nape + 0.03, nape + 0.09, top - 0.06, top]
    line = np.interp(share, [0, 0.42, 0.55, 0.8, 1.0], heights)
    region[(part == "head") & (z > line)] = HAIR
    region[eyes] = EYES
    return region
