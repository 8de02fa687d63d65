"""Cost of scenes (bake, change, query, look-up), and length of paths.

    python -m benchmarks.navigation [--seeds 3] [--pairs 100] [--json FILE] [--quick]

Times are CPU time of the one thread that does the work. Bakes and changes: the best of several.
*Ratio*: length of a path by that of the shortest possible one (a visibility graph over the same
free ground), over random pairs of reachable points.
"""

import argparse
from collections.abc import Callable
from time import thread_time
from typing import Any

import numpy as np

from benchmarks import bench
from wayfarer.navigation.examples import EXAMPLES, cubes_field
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Z_UP, Box, MeshFile, SceneSpec
from wayfarer.navigation.solids import solid_triangles
from wayfarer_lab.evaluation.scenes.pairs import random_pairs, shortest_lengths


def seconds(work: Callable[[], Any]) -> float:
    """CPU seconds of one call."""
    begun = thread_time()
    work()
    return thread_time() - begun


def best(work: Callable[[], Any], times: int) -> float:
    """The least CPU milliseconds of several calls."""
    return 1e3 * min(seconds(work) for _ in range(times))


def level(triangles: int) -> SceneSpec:
    """The cubes field as an OBJ with at least this many triangles, split in four repeatedly."""
    spec = cubes_field()
    corners = np.concatenate([_floor(20.0), *(solid_triangles(solid) for solid in spec.solids)])
    while len(corners) < triangles:
        split = min(len(corners), -(-(triangles - len(corners)) // 3))
        a, b, c = np.moveaxis(corners[:split], 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        corners = np.concatenate([corners[split:], *(np.stack(part, 1) for part in parts)])
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners.reshape(-1, 3)]
    lines += [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(len(corners))]
    return SceneSpec(mesh=MeshFile("\n".join(lines).encode(), "obj", Z_UP))


def _floor(side: float) -> np.ndarray:
    a, b, c, d = [0, 0, 0], [side, 0, 0], [side, side, 0], [0, side, 0]
    return np.array([[a, b, c], [a, c, d]], np.float64)


def cubes(seeds: int, pairs: int) -> dict[str, float]:
    """The paper's setting: 20 x 20 m, 30 boxes."""
    queries, ratios, bakes, changes = [], [], [], []
    for seed in range(seeds):
        spec = cubes_field(seed)
        bakes.append(best(lambda spec=spec: bake(spec), 5))
        scene = bake(spec)
        random = np.random.default_rng(seed)
        crates = [Box(tuple(p), (1.0, 1.0), 1.0) for p in random.uniform(1, 19, (5, 2)).tolist()]
        changes += [best(lambda c=c, s=scene: s.put("crate", c), 3) for c in crates]
        asked = random_pairs(scene, pairs, random)
        found = []
        for pair in asked:
            queries.append(best(lambda p=pair, s=scene: s.path(*p), 3))
            found.append(scene.path(*pair))
        lengths = np.array([path.length for path in found])
        ratios += (lengths / shortest_lengths(scene, asked)).tolist()
    return {
        "bake_ms": max(bakes),
        "change_ms_median": float(np.median(changes)),
        "query_ms_median": float(np.median(queries)),
        "query_ms_p95": float(np.quantile(queries, 0.95)),
        "path_ratio_mean": float(np.mean(ratios)),
        "path_ratio_p95": float(np.quantile(ratios, 0.95)),
        "path_ratio_max": float(np.max(ratios)),
        "paths": len(ratios),
    }


def lookups(scene: Scene, points: int = 10_000) -> float:
    """Microseconds of a clearance look-up, with its direction, in a batch."""
    x0, y0, x1, y1 = scene.bounds
    spots = np.random.default_rng(0).uniform((x0, y0), (x1, y1), (points, 2))
    return 1e3 * best(lambda: scene.clearance(spots), 5) / points


def main() -> None:
    """Measures, prints and writes the file of --json."""
    parser = bench.parser(__doc__)
    parser.add_argument("--seeds", type=int, help="3, or 1 when quick")
    parser.add_argument("--pairs", type=int, default=100)
    options: argparse.Namespace = parser.parse_args()
    seeds = options.seeds or (1 if options.quick else 3)
    rows = {f"cubes: {k}": v for k, v in cubes(seeds, options.pairs).items()}
    for name, make in EXAMPLES.items():
        rows[f"bake {name}, ms"] = best(lambda make=make: bake(make()), 3)
    rows["look-up of clearance, us a point"] = lookups(bake(cubes_field()))
    for triangles in (10_000, 100_000):
        spec = level(triangles)
        assert spec.mesh is not None
        count = spec.mesh.data.count(b"\nf ")
        rows[f"bake of a level of {count:,} triangles, ms"] = best(lambda s=spec: bake(s), 2)
    bench.finish(options, [{"figure": name, "value": value} for name, value in rows.items()])


if __name__ == "__main__":
    main()
