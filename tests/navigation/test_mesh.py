"""The navigation mesh: links count both ways, and a way exists wherever an island says so."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from wayfarer.errors import InvalidArgument, Unreachable
from wayfarer.navigation.mesh import NavMesh, build
from wayfarer.navigation.paths.find import corridor
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Y_UP, Z_UP, MeshFile, SceneSpec, Walkable

ONE_WAY = (Path(__file__).parent / "levels" / "one_way_level.obj").read_bytes()
SLACK = 0.075
"""Metres, as for cells of 5 cm."""


def one_way_links(mesh: NavMesh) -> set[tuple[int, int]]:
    first, behind, _ = mesh.portals
    owners = np.repeat(np.arange(len(mesh.corners)), np.diff(first))
    links = set(zip(owners.tolist(), behind.tolist(), strict=True))
    return {(a, b) for a, b in links if (b, a) not in links or a == b}


def check_ways(mesh: NavMesh, seed: int, pairs: int = 20) -> None:
    """Every pair of triangles of an island has a corridor, and no portal leads one way only."""
    assert one_way_links(mesh) == set()
    random = np.random.default_rng(seed)
    for first, last in random.integers(0, len(mesh.corners), (pairs, 2)).tolist():
        if mesh.island[first] != mesh.island[last]:
            continue
        start, goal = (tuple(mesh.corners[k].mean(0).tolist()) for k in (first, last))
        for aim in (True, False):
            numbers = corridor(mesh.portals, first, last, start, goal, aim)
            assert [first, *mesh.portals.behind[numbers]][-1] == last


def soup(seed: int, count: int, layers: int, grain: float) -> tuple[NDArray[np.float64], ...]:
    """Triangles that touch, overlap, repeat and degenerate: corners lie on a coarse grid, with a
    jitter of `grain` metres.
    """
    random = np.random.default_rng(seed)
    corners = random.integers(0, 5, (count, 3, 2)) * 0.5
    corners = corners + random.uniform(-grain, grain, corners.shape)
    sides = corners[:, 1:] - corners[:, :1]
    clockwise = sides[:, 0, 0] * sides[:, 1, 1] < sides[:, 0, 1] * sides[:, 1, 0]
    corners[clockwise] = corners[clockwise][:, ::-1]
    return corners, random.integers(0, layers, count)


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 60),
    st.integers(1, 4),
    st.sampled_from((0.0, 1e-6, 0.002, SLACK / 10, 0.05)),
)
def test_links_of_any_triangles_count_both_ways(
    seed: int, count: int, layers: int, grain: float
) -> None:
    corners, layer = soup(seed, count, layers, grain)
    check_ways(build(corners, layer, SLACK), seed)


def test_overlapping_triangles_are_linked_in_pairs() -> None:
    """Two triangles coincide, and a third is next to both: its neighbour must have it as a
    neighbour, too.
    """
    twice = [[(0, 0), (1, 0), (0, 1)]] * 2
    mesh = build(np.array([*twice, [(1, 0), (1, 1), (0, 1)]], float), np.zeros(3, int), SLACK)
    assert one_way_links(mesh) == set()
    assert sorted(np.diff(mesh.portals.first)) == [0, 1, 1]


def test_an_edge_without_a_length_is_no_link() -> None:
    mesh = build(
        np.array([[(0, 0), (0, 0), (0, 1)], [(0, 0), (0, 0), (1, 0)]], float),
        np.zeros(2, int),
        SLACK,
    )
    assert len(mesh.portals.behind) == 0


@pytest.mark.parametrize("share", [0.09, 0.0999, 0.1, 0.1001, 0.11])
@pytest.mark.parametrize("angle", [0.0, 0.1, 0.3])
def test_a_sliver_at_the_threshold_counts_both_ways_or_not_at_all(
    share: float, angle: float
) -> None:
    """Two layers whose borders run along each other for about `slack / 10`."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    one = np.array([(0, 0), (1, 0), (0.5, -1)]) * (1, 1)
    other = np.array([(1 - share * SLACK, 0.01), (2, 0.01), (1.5, 1)])
    other = (other - other[0]) @ turn.T + other[0]
    mesh = build(np.stack([one[::-1], other]), np.array([0, 1]), SLACK)
    assert one_way_links(mesh) == set()


def hilly(seed: int) -> bytes:
    """An OBJ of a hilly ground with arches: layers join in slivers at all angles."""
    random = np.random.default_rng(seed)
    side = 12
    x, y = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    z = random.uniform(0, 0.5, x.shape)
    lines = [f"v {a:.4f} {b:.4f} {c:.4f}" for a, b, c in zip(x.flat, y.flat, z.flat, strict=True)]
    faces = []
    for row in range(side):
        for k in range(side):
            a = row * (side + 1) + k + 1
            faces += [(a, a + 1, a + side + 2), (a, a + side + 2, a + side + 1)]
    for _ in range(6):  # arches: up, over, and down again
        u, v = random.uniform(1, side - 3, 2)
        angle, width, top = random.uniform(0, np.pi), random.uniform(0.8, 2), random.uniform(2.2, 3)
        along, aside = (
            np.array([np.cos(angle), np.sin(angle)]),
            np.array([-np.sin(angle), np.cos(angle)]),
        )
        first = len(lines) + 1
        for step, height in ((0, 0), (3.5, top), (4.5, top), (8, 0)):
            for edge in (-width / 2, width / 2):
                px, py = np.array([u, v]) + (step - 4) * along + edge * aside
                lines.append(f"v {px:.4f} {py:.4f} {height:.4f}")
        faces += [(first + k, first + k + 1, first + k + 3, first + k + 2) for k in (0, 2, 4)]
    text = [*lines, *("f " + " ".join(map(str, face)) for face in faces)]
    return "\n".join(text).encode()


def some_paths(scene: Scene, seed: int, count: int) -> int:
    """Checks ways between random points, with heights; returns their number."""
    random = np.random.default_rng(seed)
    x0, y0, x1, y1 = scene.bounds
    found = 0
    for _ in range(count):
        start, goal = random.uniform((x0 - 1, y0 - 1, -1), (x1 + 1, y1 + 1, 4), (2, 3)).tolist()
        try:
            path = scene.path(tuple(start), tuple(goal))
        except Unreachable:
            continue
        found += 1
        assert np.isfinite(path.points).all()
    return found


@pytest.mark.parametrize("seed", range(6))
def test_every_path_in_a_hilly_level_is_found_or_told(seed: int) -> None:
    walkable = Walkable(radius=0.3, slope_deg=45, step_height=0.35)
    try:
        scene = bake(SceneSpec(mesh=MeshFile(hilly(seed), "obj", axes=Z_UP), walkable=walkable))
    except InvalidArgument:  # too rough for standing
        return
    check_ways(scene.mesh, seed)
    some_paths(scene, seed, 10)


def test_the_level_with_a_link_that_only_one_side_saw_has_all_ways() -> None:
    scene = bake(SceneSpec(mesh=MeshFile(ONE_WAY, "obj", axes=Y_UP)))
    assert len(scene.ground.layers) > 1 and scene.islands == 1
    check_ways(scene.mesh, 0, pairs=60)
    # in glTF's basis from (9.49, 1.44, -1.94) to (-0.34, 0.24, -1.1)
    path = scene.path((-9.49, -1.94, 1.44), (0.34, -1.1, 0.24))
    assert path.goal_moved < 0.5 and path.length > 12
    assert some_paths(scene, 1, 40) == 40
