"""Bake clothes, shoes and hair of MakeHuman for the anny52 body: one file for both genders.

A garment becomes what the body is: mean vertices and directions of betas, per gender, and skin
weights. It is baked in two details, with what becomes of body and shoes beneath it (`layers.py`).
Needs the extra `bake` and the shipped body, and a folder with `base/clothes`, `base/hair` … of the
archive.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from wayfarer.body.library import DETAILS, Detail, body_file, load_arrays, load_body, write_manifest
from wayfarer.body.outfit import HAIR, JACKET, SHIRT, SHOES, SKIRT, SOCKS, SOLES, TRIM, TROUSERS
from wayfarer.body.wardrobe import BODY, DIRECTION_M, LAYOUT, PLACE_M, wardrobe_file
from wayfarer.errors import DataError
from wayfarer.spec import GENDERS
from wayfarer_lab.baking.anny_source import AnnySource
from wayfarer_lab.baking.bake import IDENTITIES, NAME, SEED
from wayfarer_lab.baking.garments import BoundGarment, connected, read_garment
from wayfarer_lab.baking.layers import (
    Beneath,
    Surface,
    beneath,
    between,
    conformed,
    lifted,
    smoothed,
    strongest,
)
from wayfarer_lab.baking.shape_space import shape_space
from wayfarer_lab.baking.simplify import alike, simplified

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]
Arrays = dict[str, NDArray[Any]]

AGREEMENT_M: Final = 5e-4
"""Metres, or metres per unit of beta, by which base mesh and shipped body may differ: it is stored
in halves of floats."""

CHIN_M: Final = 0.22
"""Metres from the top of long hair down to the chin."""

BROW_M, FACE_M = 0.08, 0.08
"""Metres from the top of hair down to the brow, and from its front back to where the face ends."""

HANGING: Final = 2
"""Rounds of smoothing the weights of what hangs."""


@dataclass(frozen=True)
class Recipe:
    """How one of MakeHuman's garments is baked."""

    source: str  # its folder and name
    region: int  # of its faces
    islands: Mapping[int, tuple[int, ...]] = field(default_factory=dict)  # region → other islands
    layers: tuple[int, ...] = ()  # regions from the inside out; the others are over them
    least: int = 0  # faces of a piece that is kept: hair has loose strands
    faces: tuple[int, int] = (6000, 1000)  # about at most, in high and in low detail
    hangs: tuple[int, ...] = ()  # regions that span both legs, and follow neither
    flare: float = 0.0  # share by which what hangs is wider at its hem
    cloth: bool = True  # whether it covers what is beneath, and bends as that does
    floor: bool = False  # whether it stands on the floor
    shorter: float = 1.0  # share of its length below the chin: hair to the waist does not bend
    parted: bool = False  # whether what falls over the face is drawn up
    genders: tuple[str, ...] = GENDERS


def _shoes(source: str, soles: tuple[int, ...], socks: tuple[int, ...], *laces: int) -> Recipe:
    islands = {SOLES: soles, SOCKS: socks, TRIM: laces}
    layers = (SOCKS, SHOES)
    return Recipe(f"clothes/{source}", SHOES, islands, layers, faces=(2200, 320), floor=True)


def _hair(source: str, least: int = 0, **more: Any) -> Recipe:
    return Recipe(f"hair/{source}", HAIR, least=least, faces=(3600, 420), cloth=False, **more)


_OVER: Final = (TROUSERS, SHIRT)  # a shirt that hangs over trousers

RECIPES: Final[Mapping[str, Recipe]] = {
    "tee_slim": Recipe(
        "clothes/female_casualsuit01", SHIRT, {TROUSERS: (4, 5)}, _OVER, genders=("female",)
    ),
    "tee_wide": Recipe(
        "clothes/male_casualsuit06", SHIRT, {TROUSERS: (4, 5)}, _OVER, genders=("male",)
    ),
    "sweater": Recipe("clothes/male_casualsuit02", SHIRT, {TROUSERS: (0, 1)}, _OVER),
    "shirt": Recipe("clothes/male_casualsuit03", SHIRT, {TROUSERS: (9, 10)}, _OVER),
    "jacket": Recipe(
        "clothes/male_casualsuit05",
        JACKET,
        {TRIM: (0, 1), SHIRT: (15, 16, 17, 18), TROUSERS: (19, 20)},
        _OVER,
    ),
    "suit": Recipe(
        "clothes/male_elegantsuit01",
        JACKET,
        {TROUSERS: (0, 1), SHIRT: (3, 6), TRIM: (*range(11, 17), 21, 22)},
        (SHIRT, TROUSERS),
        faces=(7000, 1100),
    ),
    "overalls": Recipe(
        "clothes/male_worksuit01", TROUSERS, {SHIRT: (0,), TRIM: (1, 4, 7, 8, 9, 10)}, (SHIRT,)
    ),
    "skirt": Recipe(
        "clothes/female_elegantsuit01",
        SHIRT,
        {SKIRT: (0,)},
        (SHIRT,),
        hangs=(SKIRT,),
        flare=0.35,
    ),
    "oxfords": _shoes("shoes01", (1, 3), (4, 5)),
    "slip_ons": _shoes("shoes02", (2, 3), (6, 7)),
    "laced": _shoes("shoes03", (6, 7, 8, 9, 16, 17, 18, 19), (0, 10), 1, 2, 3, 4, 11, 12, 13, 14),
    "short": _hair("short02"),
    "crop": _hair("short04", least=20),
    "bob": _hair("bob02", least=20, parted=True),
    "long": _hair("long01", least=20, shorter=0.4),
    "ponytail": _hair("ponytail01", least=20),
    "afro": _hair("afro01", least=20),
    "brows": Recipe("eyebrows/eyebrow001", HAIR, faces=(192, 48), cloth=False),
}
"""Recipes by the names that `body/outfit.py` uses."""


def bake(
    clothes: Path,
    output: Path,
    identities: int = IDENTITIES,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> dict[str, dict[str, int]]:
    """Writes anny52_wardrobe.npz and the manifest; returns the vertices of each garment's details.

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
    arrays = wardrobe_arrays(garments, bases, source.base_weights, source.base_vertices, progress)
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
    return garment.of_faces(np.bincount(piece)[piece] >= recipe.least)


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


def wardrobe_arrays(
    garments: Mapping[str, BoundGarment],
    bases: Mapping[str, tuple[Array, Array]],
    weights: Array,
    base_vertices: Index,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
) -> Arrays:
    """All garments and what lies beneath them; `weights` [19158, J] of the base mesh, and for each
    vertex of the body its number there [V].
    """
    bodies = {detail: body_surface(detail) for detail in DETAILS}
    arrays: Arrays = {}
    shoes: dict[str, dict[str, Surface]] = {}
    for done, name in enumerate(sorted(garments, key=lambda n: not RECIPES[n].floor), start=1):
        recipe = RECIPES[name]
        made, surfaces = baked(name, garments[name], recipe, bases, weights, bodies)
        arrays |= made
        for detail, surface in surfaces.items() if recipe.cloth else ():
            inner = {BODY: bodies[detail]}
            if not recipe.floor:
                inner |= {shoe: found[detail] for shoe, found in shoes.items()}
            for below, skin in inner.items():
                key = f"{name}/{detail}/over/{below}"
                if below == BODY:
                    listed = numbered(garments[name].hides, base_vertices, detail)
                    found = beneath(skin, surface, detail, listed, bool(recipe.hangs))
                else:
                    found = between(skin, surface, detail)
                arrays |= covering(key, found)
        if recipe.floor:
            shoes[name] = surfaces
        progress("garments", done, len(garments))
    return arrays


def body_surface(detail: Detail) -> Surface:
    """The shipped body in both genders, of mean shape."""
    bodies = {gender: load_body(NAME, gender, detail) for gender in GENDERS}
    body = bodies[GENDERS[0]]
    dense = np.zeros((len(body.skin_joints), len(body.parents)))
    np.add.at(dense, (np.arange(len(dense))[:, None], body.skin_joints), body.skin_weights)
    return Surface({g: found.bind_vertices for g, found in bodies.items()}, body.faces, dense)


def numbered(hides: Index, base_vertices: Index, detail: str) -> Index:
    """Vertices of the body in a detail for vertices of the base mesh."""
    high = np.isin(base_vertices, hides)
    if detail == "high":
        return np.flatnonzero(high)
    body = load_arrays(body_file(NAME, GENDERS[0]))
    return np.flatnonzero(high[KDTree(body["bind_vertices"]).query(body["low_bind_vertices"])[1]])


def covering(key: str, found: Beneath) -> Arrays:
    """What becomes of a mesh beneath a garment, as arrays whose names begin with `key`."""
    tucks = np.flatnonzero(found.tucked)
    if not len(tucks):
        return {}
    joints, skin = strongest(found.weights[tucks])
    return {
        f"{key}/hides": np.flatnonzero(found.hidden).astype(np.uint16),
        f"{key}/tucks": tucks.astype(np.uint16),
        f"{key}/shifts": _stored(found.shifts[tucks], PLACE_M, key),
        f"{key}/skin_joints": joints,
        f"{key}/skin_weights": skin,
    }


def baked(
    name: str,
    garment: BoundGarment,
    recipe: Recipe,
    bases: Mapping[str, tuple[Array, Array]],
    weights: Array,
    bodies: Mapping[str, Surface],
) -> tuple[Arrays, dict[str, Surface]]:
    """Both details of a garment, as arrays whose names begin with its name and the detail's.

    Also its surface by detail, of mean shape. `bodies` by detail.
    """
    region = np.full(len(garment.faces), recipe.region)
    for number, islands in recipe.islands.items():
        region[np.isin(garment.islands, islands)] = number
    whole = Surface(
        {gender: garment.place(bases[gender][0]) for gender in recipe.genders},
        garment.faces,
        garment.skin_weights(weights),
    )
    if recipe.cloth and not recipe.floor:
        weights = conformed(whole, bodies["high"])
        loose = np.unique(garment.faces[np.isin(region, recipe.hangs)])
        weights[loose] = smoothed(weights, garment.faces, HANGING)[loose]
        whole = replace(whole, weights=weights)
        for place in whole.vertices.values() if len(loose) else ():
            flared(place, loose, recipe.flare)
    seen = layered(whole, region, recipe.layers, "high")[1]
    whole, region = whole.of_faces(seen), region[seen]
    arrays: Arrays = {}
    surfaces = {}
    for detail, most in zip(DETAILS, recipe.faces, strict=True):
        hems = recipe.region not in (HAIR, SHOES)
        coarse = simplified(whole.mean, whole.faces, most, hems, alike(whole.faces, region))
        corners, shares = coarse.corners, coarse.shares

        def at(values: Array, corners: Index = corners, shares: Array = shares) -> Array:
            return np.einsum("vk,vk...->v...", shares, values[corners])

        directions = {}
        places = {gender: at(mean) for gender, mean in whole.vertices.items()}
        for gender, place in places.items():
            base, changes = bases[gender]
            directions[gender] = at(garment.directions(changes, base))
            if recipe.shorter < 1.0:
                shorten(place, directions[gender], recipe.shorter)
            if recipe.parted:
                part(place, directions[gender])
            if recipe.floor:
                place[:, 2] = np.maximum(place[:, 2], 0.0)  # a sole stands where the foot stood
        worn = region[coarse.source]
        surface = Surface(places, coarse.faces, at(whole.weights))
        if recipe.cloth and not recipe.floor:
            surface = lifted(surface, bodies[detail], detail)
        surface, seen = layered(surface, worn, recipe.layers, detail)
        used, own = np.unique(surface.faces[seen], return_inverse=True)
        faces = own.reshape(-1, 3)
        joints, skin = strongest(surface.weights[used])
        arrays |= {
            f"{name}/{detail}/faces": faces.astype(np.uint16),
            f"{name}/{detail}/regions": worn[seen].astype(np.uint8),
            f"{name}/{detail}/skin_joints": joints,
            f"{name}/{detail}/skin_weights": skin,
        }
        for gender, place in surface.vertices.items():
            key = f"{name}/{detail}/{gender}"
            arrays[f"{key}/vertices"] = _stored(place[used], PLACE_M, key)
            arrays[f"{key}/vertices_dirs"] = _stored(directions[gender][used], DIRECTION_M, key)
        own_places = {gender: place[used] for gender, place in surface.vertices.items()}
        surfaces[detail] = Surface(own_places, faces, surface.weights[used])
    return arrays, surfaces


def layered(
    surface: Surface, region: Index, layers: tuple[int, ...], detail: str
) -> tuple[Surface, NDArray[np.bool_]]:
    """A garment whose inner layers lie below the outer ones; which faces [F] are seen."""
    rank = np.array([layers.index(r) if r in layers else len(layers) for r in region])
    seen = np.ones(len(rank), bool)
    for layer in range(len(layers)):
        if not (rank == layer).any() or not (rank > layer).any():
            continue
        inner, cover = surface.of_faces(rank == layer), surface.of_faces(rank > layer)
        above = np.zeros((len(surface.weights), 1), bool)
        above[np.setdiff1d(cover.faces, inner.faces)] = True
        raised = lifted(cover, inner, detail).vertices
        places = {g: np.where(above, raised[g], place) for g, place in surface.vertices.items()}
        surface = replace(surface, vertices=places)
        inner, cover = replace(inner, vertices=places), replace(cover, vertices=places)
        found = between(inner, cover, detail)
        own = found.tucked & ~np.isin(np.arange(len(found.tucked)), cover.faces)
        seen &= ~((rank == layer) & found.hidden[surface.faces].all(-1))
        shifts = np.where(own[:, None], found.shifts, 0.0)
        moved = {gender: place + shifts for gender, place in surface.vertices.items()}
        weights = np.where(own[:, None], found.weights, surface.weights)
        surface = Surface(moved, surface.faces, weights)
    return surface, seen


def flared(places: Array, loose: Index, share: float) -> None:
    """Makes what hangs [N] of places [V, 3] wider, the more the lower."""
    hanging = places[loose]
    top, bottom = hanging[:, 2].max(), hanging[:, 2].min()
    wider = share * ((top - hanging[:, 2]) / (top - bottom))[:, None]
    middle = (hanging[:, :2].max(0) + hanging[:, :2].min(0)) / 2
    places[loose, :2] = middle + (1 + wider) * (hanging[:, :2] - middle)


def shorten(places: Array, directions: Array, share: float) -> None:
    """Draws what hangs below the chin nearer to it: heights of places [V, 3], directions [V, 3, B].

    The chin is CHIN_M below the highest vertex.
    """
    top = places[:, 2].argmax()
    chin, change = places[top, 2] - CHIN_M, directions[top, 2].copy()
    below = places[:, 2] < chin
    places[below, 2] = chin + share * (places[below, 2] - chin)
    directions[below, 2] = change + share * (directions[below, 2] - change)


def part(places: Array, directions: Array) -> None:
    """Draws up to the brow what falls over a face: places [V, 3], directions [V, 3, B]."""
    top, front = places[:, 2].argmax(), places[:, 1].max()
    brow, change = places[top, 2] - BROW_M, directions[top, 2]
    ahead = np.clip((places[:, 1] - front + FACE_M) / (FACE_M / 2), 0.0, 1.0)
    share = np.where(places[:, 2] < brow, 1 - 0.8 * ahead, 1.0)
    places[:, 2] = brow + share * (places[:, 2] - brow)
    directions[:, 2] = change + share[:, None] * (directions[:, 2] - change)


def _stored(values: Array, unit: float, key: str) -> NDArray[np.int16]:
    steps = (values / unit).round()
    if np.abs(steps).max() > np.iinfo(np.int16).max:
        raise DataError(f"{key}: places of up to {np.abs(values).max():.1f} m cannot be stored")
    return steps.astype(np.int16)
