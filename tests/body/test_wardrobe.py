"""Clothes, shoes and hair on the body: chosen by a seed, or by name."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pygltflib
import pytest
from scipy.spatial import KDTree

from wayfarer.body.glb import body_glb
from wayfarer.body.library import load_body
from wayfarer.body.outfit import (
    BARE,
    EYEBALLS,
    EYES,
    HAIRCUTS,
    OUTFITS,
    REGIONS,
    SHOE_KINDS,
    SHOES,
    SKIN,
    look,
)
from wayfarer.body.wardrobe import dressed, load_garment
from wayfarer.errors import InvalidArgument

BODIES = [(gender, detail) for gender in ("female", "male") for detail in ("high", "low")]
LIGHT = {
    "vertices": 3072,
    "faces": 4096,
}  # at most: a page draws hundreds


def test_there_is_something_to_choose_from():
    assert len(OUTFITS) >= 6 and len(SHOE_KINDS) >= 4
    assert len({cut for cuts in HAIRCUTS.values() for cut in cuts if cut}) >= 6
    assert all("" in cuts for cuts in HAIRCUTS.values()), "and none"


def test_a_seed_has_one_look_and_seeds_differ():
    looks = [look(seed, "female") for seed in range(200)]
    assert looks == [look(seed, "female") for seed in range(200)]
    assert len(set(looks)) > 190
    assert set(Counter(found.outfit for found in looks)) == set(OUTFITS)
    assert {look(seed, "male").outfit for seed in range(200)} == set(OUTFITS) - {"skirt"}


@pytest.mark.parametrize("outfit", OUTFITS)
def test_an_outfit_by_name_keeps_the_seeds_skin_and_hair(outfit):
    own, named = look(3, "male"), look(3, "male", outfit)
    assert named.outfit == outfit
    assert named.colours[:2] == own.colours[:2] and named.garments[2:] == own.garments[2:]


def test_an_unknown_outfit_is_refused_with_those_there_are():
    with pytest.raises(
        InvalidArgument, match=r"no outfit 'toga'; there are tee, .* 0 for"
    ) as caught:
        look(0, "female", "toga")
    assert caught.value.field == "outfit"


@pytest.mark.parametrize("outfit", OUTFITS)
@pytest.mark.parametrize(("gender", "detail"), BODIES)
def test_clothes_hide_what_is_below_and_move_with_the_body(gender, detail, outfit):
    body = load_body("anny52", gender, detail)
    worn = look(1, gender, outfit)
    result, region = dressed(body, worn)
    count = len(body.faces)
    assert (region == SKIN).sum() < count / 2 + 2500, "most of the skin is hidden"
    assert len(region) == len(result.faces) and result.faces.max() < len(result.bind_vertices)
    np.testing.assert_allclose(result.skin_weights.sum(-1), 1)
    betas = np.zeros(10)
    betas[0] = 2.0
    stands = result.rest_vertices(betas)
    naked = body.rest_vertices(betas)
    used = np.unique(result.faces)
    assert np.abs(stands[used]).max() < 2.1
    clothes = stands[used[used >= len(naked)]]
    # of a tall person, too, clothes are within the hand's breadth of the skin, and hair not far
    assert KDTree(naked).query(clothes)[0].max() < 0.2
    assert abs(stands[result.faces[region == SHOES]][..., 2].min()) < 0.02, "shoes on the floor"


@pytest.mark.parametrize("outfit", OUTFITS)
@pytest.mark.parametrize("gender", ["female", "male"])
def test_light_bodies_fit_the_viewers_stretches(gender, outfit):
    for seed in range(6):
        data = body_glb(load_body("anny52", gender, "low"), np.zeros(10), seed, outfit)
        document = pygltflib.GLTF2.load_from_bytes(data)
        parts = document.meshes[0].primitives
        count = sum(document.accessors[part.attributes.POSITION].count for part in parts)
        assert count <= LIGHT["vertices"]
        corners = sum(document.accessors[part.indices].count for part in parts)
        assert corners <= 3 * LIGHT["faces"]


@pytest.mark.parametrize(("gender", "detail"), BODIES)
def test_the_bare_body_is_the_body(gender, detail):
    body = load_body("anny52", gender, detail)
    result, region = dressed(body, look(5, gender, BARE))
    np.testing.assert_array_equal(result.faces, body.faces)
    np.testing.assert_array_equal(result.bind_vertices, body.bind_vertices)
    assert set(region.tolist()) == ({SKIN, EYES, EYEBALLS} if detail == "high" else {SKIN, EYES})


def test_a_body_without_a_wardrobe_wears_paint():
    body = replace(load_body("anny52", "female", "low"), name="smplx")
    _, region = dressed(body, look(1, "neutral"))
    assert {REGIONS[number] for number in np.unique(region)} >= {"shirt", "trousers", "shoes"}
    bare, region = dressed(body, look(1, "neutral", BARE))
    assert bare is body and set(region.tolist()) <= {SKIN, EYES}


def test_garments_are_loaded_once():
    assert load_garment("suit", "male", "low") is load_garment("suit", "male", "low")
