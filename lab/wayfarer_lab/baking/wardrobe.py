"""Bake clothes, shoes and hair of MakeHuman for the anny52 body: one file for both genders.

A garment becomes what the body is: mean vertices and directions of betas, per gender, and skin
weights. It is baked in two details, with the body's vertices that it hides in each. Needs the extra
`bake` and the shipped body, and a folder with `base/clothes`, `base/hair` … of the archive.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from wayfarer.body.library import DETAILS, body_file, load_arrays, write_manifest
from wayfarer.body.model import largest_weights
from wayfarer.body.outfit import HAIR, JACKET, SHIRT, SHOES, SKIRT, SOCKS, SOLES, TRIM, TROUSERS
from wayfarer.body.wardrobe import DIRECTION_M, LAYOUT, PLACE_M, wardrobe_file
from wayfarer.errors import DataError
from wayfarer.spec import GENDERS
from wayfarer_lab.baking.anny_source import AnnySource
from wayfarer_lab.baking.bake import IDENTITIES, NAME, SEED
from wayfarer_lab.baking.garments import BoundGarment, connected, read_garment
from wayfarer_lab.baking.shape_space import shape_space
from wayfarer_lab.baking.texture import nearest

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]
Arrays = dict[str, NDArray[Any]]

AGREEMENT_M: Final = 5e-4
"""Metres, or metres per unit of beta, by which base mesh and shipped body may differ: it is stored
in halves of floats."""

CHIN_M: Final = 0.22
"""Metres from the top of long hair down to the chin."""

NEAR: Final = 40
"""Faces among which the one under a vertex of a coarser mesh is looked for."""


@dataclass(frozen=True)
class Recipe:
    """What becomes of one of MakeHuman's garments."""

    source: str  # its folder and name
    region: int  # what its faces are …
    islands: Mapping[int, tuple[int, ...]] = field(default_factory=dict)  # … except these
    least: int = 0  # faces of a piece that is kept: hair has loose strands
    without: tuple[int, ...] = ()  # pieces that are left out
    faces: tuple[int, int] = (6000, 1000)  # about at most, in high and in low detail
    floor: bool = False  # whether it stands on the floor
    shorter: float = 1.0  # share of its length below the chin: hair to the waist does not bend
    genders: tuple[str, ...] = GENDERS


def _shoes(source: str, soles: tuple[int, ...], socks: tuple[int, ...], *laces: int) -> Recipe:
    islands = {SOLES: soles, SOCKS: socks, TRIM: laces}
    return Recipe(f"clothes/{source}", SHOES, islands, faces=(2200, 320), floor=True)


def _hair(source: str, least: int = 0, low: int = 420, **more: Any) -> Recipe:
    return Recipe(f"hair/{source}", HAIR, least=least, faces=(3600, low), **more)


RECIPES: Final[Mapping[str, Recipe]] = {
    "tee_slim": Recipe(
        "clothes/female_casualsuit01", SHIRT, {TROUSERS: (4, 5)}, genders=("female",)
    ),
    "tee_wide": Recipe("clothes/male_casualsuit06", SHIRT, {TROUSERS: (4, 5)}, genders=("male",)),
    "sweater": Recipe("clothes/male_casualsuit02", SHIRT, {TROUSERS: (0, 1)}),
    "shirt": Recipe("clothes/male_casualsuit03", SHIRT, {TROUSERS: (9, 10)}),
    "jacket": Recipe(
        "clothes/male_casualsuit05",
        JACKET,
        {TRIM: (0, 1), SHIRT: (15, 16, 17, 18), TROUSERS: (19, 20)},
    ),
    "suit": Recipe(
        "clothes/male_elegantsuit01",
        JACKET,
        {TROUSERS: (0, 1), SHIRT: (3, 6), TRIM: (*range(11, 17), 21, 22)},
        faces=(7000, 1100),
    ),
    "overalls": Recipe(
        "clothes/male_worksuit01", TROUSERS, {SHIRT: (0,), TRIM: (1, 4, 7, 8, 9, 10)}
    ),
    "skirt": Recipe("clothes/female_elegantsuit01", SHIRT, {SKIRT: (0,)}),
    "oxfords": _shoes("shoes01", (1, 3), (4, 5)),
    "slip_ons": _shoes("shoes02", (2, 3), (6, 7)),
    "laced": _shoes("shoes03", (6, 7, 8, 9, 16, 17, 18, 19), (0, 10), 1, 2, 3, 4, 11, 12, 13, 14),
    "short": _hair("short02"),
    "crop": _hair("short04", least=20),
    "bob": _hair("bob02", least=20, without=(6, 13, 15)),  # of the fringe that hides an eye
    "long": _hair("long01", least=20, shorter=0.4),
    "ponytail": _hair("ponytail01", least=20),
    "afro": _hair("afro01", least=20),
    "brows": Recipe("eyebrows/eyebrow001", HAIR, faces=(192, 48)),
}
"""By the name under which `body/outfit.py` asks for them."""


def bake(
    clothes: Path,
    output: Path,
    identities: int = IDENTITIES,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> dict[str, dict[str, int]]:
    """Write anny52_wardrobe.npz and the manifest; return the vertices of each garment's details.

    `clothes` is the folder with `base`, where the archive was unpacked. Raises ImportError without
    anny, DataError where a garment is missing or is none.
    """
    garments = {name: find(clothes, recipe) for name, recipe in RECIPES.items()}
    source = AnnySource()
    bases = {}
    for k, gender in enumerate(GENDERS):

        def heard(done: int, stage: str = f"{gender} identities") -> None:
            progress(stage, done, identities)

        bases[gender] = base_mesh(source, gender, SEED + k, identities, heard)
        check_base(gender, bases[gender], source.base_vertices)
    weights = source.base_weights
    arrays: Arrays = {}
    for done, (name, garment) in enumerate(garments.items(), start=1):
        arrays |= baked(name, garment, RECIPES[name], bases, weights)
        progress("garments", done, len(garments))
    arrays |= _hidden(garments, source.base_vertices)
    meta = {"layout": LAYOUT, "name": NAME, "source": "MakeHuman assets (CC0 1.0), hm08"}
    output.mkdir(parents=True, exist_ok=True)
    path = output / wardrobe_file(NAME)
    np.savez_compressed(path, allow_pickle=False, **arrays, meta=np.array(json.dumps(meta)))
    write_manifest(output)
    return {name: {d: len(arrays[f"{name}/{d}/skin_joints"]) for d in DETAILS} for name in RECIPES}


def find(clothes: Path, recipe: Recipe) -> BoundGarment:
    """The garment of a recipe, without its loose strands. Raises DataError."""
    folder = clothes / "base" / recipe.source
    path = folder / f"{folder.name}.mhclo"
    if not path.is_file():
        raise DataError("is missing: unpack the archive of clothes there", str(path))
    garment = read_garment(path)
    piece = connected(garment.faces)
    large = np.bincount(piece)[piece] >= recipe.least
    return garment.of_faces(large & ~np.isin(piece, recipe.without))


def base_mesh(
    source: AnnySource, gender: str, seed: int, identities: int, heard: Callable[[int], None]
) -> tuple[Array, Array]:
    """The base mesh with its helpers, mean [19158, 3] and directions [19158, 3, 10] of betas.

    The identities are those of the body, and stand where it stands.
    """
    people = source.people(gender, identities, seed, heard)
    space = shape_space(people, source.mesh)
    lift = (space.vertices - people.vertices)[:, :1]
    vertices = source.base(people.phenotypes) + lift
    return vertices.mean(0), space.directions(vertices)


def check_base(gender: str, base: tuple[Array, Array], vertices: Index) -> None:
    """Raises DataError where the base mesh is not that of the shipped body."""
    body = load_arrays(body_file(NAME, gender))
    for values, key in zip(base, ("bind_vertices", "bind_vertices_dirs"), strict=True):
        off = float(np.abs(values[vertices] - body[key]).max())
        if off > AGREEMENT_M:
            raise DataError(f"{gender} {key} differ from the shipped body's by {off * 1e3:.1f} mm")


def baked(
    name: str,
    garment: BoundGarment,
    recipe: Recipe,
    bases: Mapping[str, tuple[Array, Array]],
    weights: Array,
) -> Arrays:
    """Both details of a garment, as arrays whose names begin with its name and the detail's."""
    region = np.full(len(garment.faces), recipe.region)
    for number, islands in recipe.islands.items():
        region[np.isin(garment.islands, islands)] = number
    means = {gender: garment.place(bases[gender][0]) for gender in recipe.genders}
    shape = np.mean([*means.values()], axis=0)
    own = garment.skin_weights(weights)
    arrays: Arrays = {}
    for detail, most in zip(DETAILS, recipe.faces, strict=True):
        coarse = simplified(shape, garment.faces, most, hems=recipe.region not in (HAIR, SHOES))
        corners, shares = coarse.corners, coarse.shares

        def at(values: Array, corners: Index = corners, shares: Array = shares) -> Array:
            return np.einsum("vk,vk...->v...", shares, values[corners])

        joints, skin = largest_weights(at(own))
        arrays |= {
            f"{name}/{detail}/faces": coarse.faces.astype(np.uint16),
            f"{name}/{detail}/regions": region[coarse.source].astype(np.uint8),
            f"{name}/{detail}/skin_joints": joints.astype(np.uint8),
            f"{name}/{detail}/skin_weights": (255 * skin).round().astype(np.uint8),
        }
        for gender, mean in means.items():
            base, changes = bases[gender]
            places, directions = at(mean), at(garment.directions(changes, base))
            if recipe.shorter < 1.0:
                shorten(places, directions, recipe.shorter)
            if recipe.floor:
                places[:, 2] = np.maximum(places[:, 2], 0.0)  # a sole stands where the foot stood
            key = f"{name}/{detail}/{gender}"
            arrays[f"{key}/vertices"] = _stored(places, PLACE_M, key)
            arrays[f"{key}/vertices_dirs"] = _stored(directions, DIRECTION_M, key)
    return arrays


def shorten(places: Array, directions: Array, share: float) -> None:
    """Draw what hangs below the chin nearer to it: heights of places [V, 3], directions [V, 3, B].

    The chin is CHIN_M below the highest vertex.
    """
    top = places[:, 2].argmax()
    chin, change = places[top, 2] - CHIN_M, directions[top, 2].copy()
    below = places[:, 2] < chin
    places[below, 2] = chin + share * (places[below, 2] - chin)
    directions[below, 2] = change + share * (directions[below, 2] - change)


def _stored(values: Array, unit: float, key: str) -> NDArray[np.int16]:
    steps = (values / unit).round()
    if np.abs(steps).max() > np.iinfo(np.int16).max:
        raise DataError(f"{key}: places of up to {np.abs(values).max():.1f} m cannot be stored")
    return steps.astype(np.int16)


@dataclass(frozen=True)
class Coarse:
    """A mesh with fewer faces; each vertex V' lies on a face of the finer one."""

    faces: Index  # [F', 3]
    source: Index  # [F'] face of the finer mesh that each lies on
    corners: Index  # [V', 3] vertices of that mesh
    shares: Array  # [V', 3] of them, sum to 1


def simplified(vertices: Array, faces: Index, most: int, hems: bool = True) -> Coarse:
    """A mesh of at most about so many faces; the same mesh if it has no more. `hems`: they stay."""
    if len(faces) <= most:
        used, own = np.unique(faces, return_inverse=True)
        corners = np.repeat(used[:, None], 3, axis=1)
        shares = np.tile([1.0, 0.0, 0.0], (len(used), 1))
        return Coarse(own.reshape(faces.shape), np.arange(len(faces)), corners, shares)
    import pyfqmr

    mesh = pyfqmr.Simplify()
    mesh.setMesh(vertices, faces)
    mesh.simplify_mesh(target_count=most, aggressiveness=3, preserve_border=hems, verbose=False)
    points, found = (np.asarray(part) for part in mesh.getMesh()[:2])
    found = found.astype(np.int64)
    used, own = np.unique(found, return_inverse=True)
    found, points = own.reshape(-1, 3), points[used]
    triangles = vertices[faces]
    tree = KDTree(triangles.mean(1))

    def under(places: Array) -> tuple[Index, Array]:
        """The face under each place [N], and the corners' shares [N, 3]."""
        _, close = tree.query(places, min(NEAR, len(faces)))
        rows = [
            nearest(place[None], triangles[near])[1:]
            for place, near in zip(places, close, strict=True)
        ]
        face = np.array([near[row[0][0]] for row, near in zip(rows, close, strict=True)])
        return face, np.array([row[1][0] for row in rows])

    face, shares = under(points)
    middle, _ = under(points[found].mean(1))
    return Coarse(found, middle, faces[face], shares)


def _hidden(garments: Mapping[str, BoundGarment], base: Index) -> Arrays:
    """Vertices of the body, in each detail, under each garment; `base`: [V] of the base mesh."""
    body = load_arrays(body_file(NAME, GENDERS[0]))
    low = KDTree(body["bind_vertices"]).query(body["low_bind_vertices"])[1]
    arrays: Arrays = {}
    for name, garment in garments.items():
        high = np.isin(base, garment.hides)
        arrays[f"{name}/high/hides"] = np.flatnonzero(high).astype(np.uint16)
        arrays[f"{name}/low/hides"] = np.flatnonzero(high[low]).astype(np.uint16)
    return arrays
