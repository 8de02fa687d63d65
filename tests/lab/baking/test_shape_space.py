"""Betas from a population whose true shape space is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from wayfarer.body.library import load_body
from wayfarer_lab.baking import check
from wayfarer_lab.baking.anny_source import AnnyMesh, symmetric
from wayfarer_lab.baking.shape_space import shape_space, vertex_areas


@pytest.fixture(scope="module")
def population():
    """Sixty bodies drawn from the low-poly anny52, each at another height above the floor."""
    body = load_body("anny52", "male", "low")
    rng = np.random.default_rng(0)
    betas = rng.normal(size=(60, 10))
    lift = rng.normal(size=(60, 1, 1)) * np.array([0, 0, 1.0])
    vertices = body.bind_vertices + np.einsum("vcb,nb->nvc", body.bind_vertices_dirs, betas)
    joints = body.bind_joints + np.einsum("jcb,nb->njc", body.bind_joints_dirs, betas)
    people = SimpleNamespace(
        vertices=vertices + lift, joints=joints + lift, low_vertices=vertices[:, ::10] + lift
    )
    return people, AnnyMesh(body.faces, body._dense_weights)


def test_ten_betas_give_the_population_back(population):
    people, mesh = population
    space = shape_space(people, mesh)
    np.testing.assert_allclose(space.betas.mean(0), 0, atol=1e-9)
    np.testing.assert_allclose(space.betas.T @ space.betas / 60, np.eye(10), atol=1e-9)
    for values in (space.vertices, space.joints, space.low_vertices):
        made = values.mean(0) + np.einsum("vcb,nb->nvc", space.directions(values), space.betas)
        # not exact: the floor is the lowest of many vertices, which is not linear
        assert np.abs(made - values).max() < 1e-3


def test_everybody_stands_on_the_floor(population):
    people, mesh = population
    space = shape_space(people, mesh)
    for vertices, joints in zip(space.vertices, space.joints, strict=True):
        one = replace(space.mean, bind_vertices=vertices, bind_joints=joints)
        assert one.rest_vertices(np.zeros(0))[:, 2].min() == pytest.approx(0, abs=1e-9)


def test_a_positive_beta_is_a_taller_body(population):
    people, mesh = population
    space = shape_space(people, mesh)
    stature = np.ptp(space.vertices[..., 2], axis=1)
    assert (space.betas.T @ (stature - stature.mean()) > -1e-9).all()


def test_areas_sum_to_the_surface():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    areas = vertex_areas(square, np.array([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(areas, [1 / 3, 1 / 6, 1 / 3, 1 / 6])


def test_joints_become_symmetric():
    joints = np.random.default_rng(1).normal(size=(2, 52, 3))
    once = symmetric(joints)
    np.testing.assert_allclose(symmetric(once), once)
    np.testing.assert_allclose(once[:, 0, 0], 0)


def test_betas_of_a_known_body_are_found_with_its_lift():
    body = load_body("anny52", "female", "low")
    betas = np.linspace(-2, 2, 10)
    mesh = body.bind_vertices + body.bind_vertices_dirs @ betas - [0, 0, 0.3]
    found, lift = check.fit_betas(body, mesh)
    np.testing.assert_allclose(found, betas, atol=1e-6)
    np.testing.assert_allclose(lift, [0, 0, 0.3], atol=1e-8)
