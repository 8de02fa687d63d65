"""Betas from a description."""

import itertools

import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer.body.phenotype import LIMITS, betas_from_phenotype, height_of
from wayfarer.errors import InvalidArgument, NotFound
from wayfarer.spec import GENDERS


@pytest.mark.parametrize("gender", GENDERS)
def test_height_is_met_over_all_of_the_allowed_ranges(gender):
    body = load_body("anny52", gender)
    for values in itertools.product(*LIMITS.values()):
        betas = betas_from_phenotype(gender, *values)
        body.check_betas(betas)
        mesh = body.rest_vertices(betas)[:, 2]
        assert np.ptp(mesh) == pytest.approx(values[0], abs=0.005)
        assert height_of(gender, betas) == pytest.approx(values[0], abs=0.001)


def girth(gender, **phenotype):
    """Width of the waist in metres."""
    body = load_body("anny52", gender)
    betas = betas_from_phenotype(gender, 1.7, **phenotype)
    places = body.rest_vertices(betas, body.marker_vertices)
    at = dict(zip(body.marker_names, places, strict=True))
    return at["RNWST"][0] - at["LNWST"][0]


@pytest.mark.parametrize("gender", GENDERS)
def test_weight_widens_the_waist(gender):
    widths = [girth(gender, weight=weight) for weight in (0.1, 0.5, 0.9)]
    assert widths[0] < widths[1] - 0.01 < widths[2] - 0.02


@pytest.mark.parametrize("gender", GENDERS)
def test_muscle_and_age_change_the_body(gender):
    usual = betas_from_phenotype(gender, 1.7)
    for changed in ({"muscle": 0.9}, {"age": 75.0}):
        assert np.abs(betas_from_phenotype(gender, 1.7, **changed) - usual).max() > 0.3


@pytest.mark.parametrize(
    ("field", "value"),
    [("height_m", 1.2), ("height_m", 180), ("weight", -0.1), ("muscle", 1.1), ("age", 12)],
)
def test_values_out_of_range_are_named_with_the_range(field, value):
    with pytest.raises(InvalidArgument, match=field) as caught:
        betas_from_phenotype("male", **({"height_m": 1.7} | {field: value}))
    assert caught.value.field == field
    assert f"{LIMITS[field][0]:g}" in str(caught.value)


def test_not_a_number_is_refused():
    with pytest.raises(InvalidArgument, match="weight"):
        betas_from_phenotype("female", 1.7, weight=float("nan"))


def test_unknown_gender():
    with pytest.raises(NotFound, match="male, female"):
        betas_from_phenotype("other", 1.7)
