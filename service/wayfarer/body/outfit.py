"""Clothes of people and their colours, so that they look dressed and different.

A seed chooses outfit, shoes, haircut and colours: the same seed, the same look.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body.model import BodyModel
from wayfarer.errors import InvalidArgument

Array = NDArray[np.floating[Any]]

SKIN, HAIR, SHIRT, TROUSERS, SHOES, EYES = range(6)  # where two meet, the greater number is outside
JACKET, SKIRT, SOCKS, SOLES, TRIM, EYEBALLS = range(6, 12)

REGIONS: Final = (
    "skin", "hair", "shirt", "trousers", "shoes", "eyes",
    "jacket", "skirt", "socks", "soles", "trim", "eyeballs",
)  # fmt: skip
"""Their names, in the order of the constants above."""

ROUGHNESS: Final = (0.75, 0.6, 0.9, 0.9, 0.6, 0.35, 0.85, 0.9, 0.95, 0.8, 0.7, 0.4)
"""Roughness of each region, as glTF defines it."""

SKINS: Final = ("#ecc8ad", "#deb090", "#cf9a78", "#b07a56", "#8d5c40", "#6f452f")
HAIRS: Final = ("#1d1916", "#3b2a20", "#5d4030", "#8a6642", "#b8935a", "#7d7a78")
SHIRTS: Final = (
    "#c06a4f", "#2f6f8f", "#e0a83e", "#4c8c6b", "#7a5c99", "#e8e4da", "#35465c", "#b9637d",
    "#8fa9b8", "#5f6b3f",
)  # fmt: skip
PALE: Final = ("#eef0f2", "#cfdceb", "#e9dfd0", "#dfd3e3")
DENIM: Final = ("#2c3f5e", "#44526b", "#5a6f8f", "#30343c")
TROUSER: Final = ("#2c3340", "#44526b", "#5b5147", "#30343c", "#8a8371", "#3d4a3e", "#2c3f5e")
COATS: Final = ("#4a4d3a", "#27313f", "#6b5a45", "#4a4440", "#7c4a35", "#51606b")
SUITS: Final = ("#353b4a", "#3b3e46", "#363a45", "#4b4a52", "#3a4258", "#5a5148")
SKIRTS: Final = ("#2b2d36", "#6a2f3c", "#3f4c3c", "#4a4058", "#7b6a55", "#29405a")
LEATHERS: Final = ("#1f2023", "#4a3427", "#6b4a35", "#2f2a28")
TRAINERS: Final = ("#e9e6e0", "#31343a", "#7d2f2f", "#41586b", "#1f2023")

BARE: Final = "0"
"""The name of the outfit of a body that wears nothing, and has no hair."""


@dataclass(frozen=True)
class Outfit:
    """Names of garments and shoes among which a seed chooses, and colours of regions."""

    garments: Mapping[str, str]  # by gender
    shoes: tuple[str, ...]
    colours: Mapping[int, Sequence[str]]
    share: Mapping[str, int]  # relative frequency, by gender


def _outfit(
    garments: str | dict[str, str],
    shoes: tuple[str, ...],
    share: tuple[int, int],
    **colours: Sequence[str],
) -> Outfit:
    both = garments if isinstance(garments, dict) else dict.fromkeys(("female", "male"), garments)
    chosen = {REGIONS.index(region): palette for region, palette in colours.items()}
    return Outfit(both, shoes, chosen, dict(zip(("female", "male"), share, strict=True)))


_CASUAL: Final = ("trainers", "slip_ons", "laced")

OUTFITS: Final[Mapping[str, Outfit]] = {
    "tee": _outfit(
        {"female": "tee_slim", "male": "tee_wide"}, _CASUAL, (3, 3), shirt=SHIRTS, trousers=DENIM
    ),
    "sweater": _outfit("sweater", _CASUAL, (2, 2), shirt=SHIRTS, trousers=TROUSER),
    "shirt": _outfit("shirt", ("slip_ons", "laced"), (2, 2), shirt=PALE + SHIRTS, trousers=TROUSER),
    "jacket": _outfit(
        "jacket", ("boots", "trainers", "laced"), (2, 3),
        jacket=COATS, shirt=PALE, trousers=DENIM, trim=("#2b2623", "#4a3b2e"),
    ),
    "suit": _outfit(
        "suit", ("oxfords",), (1, 2), jacket=SUITS, shirt=PALE, trim=("#17181b",)
    ),
    "overalls": _outfit(
        "overalls", ("boots", "laced"), (1, 1),
        trousers=("#34507a", "#5c4a38", "#4f5b45"), shirt=SHIRTS, trim=("#c9b27a",),
    ),
    "skirt": _outfit("skirt", ("slip_ons", "oxfords"), (3, 0), shirt=PALE + SHIRTS, skirt=SKIRTS),
}  # fmt: skip
"""Outfits by name. Anyone may ask for a skirt; a seed gives it to women."""

SHOE_KINDS: Final[Mapping[str, tuple[str, Sequence[str]]]] = {
    "oxfords": ("oxfords", LEATHERS),
    "slip_ons": ("slip_ons", LEATHERS),
    "trainers": ("slip_ons", TRAINERS),  # with white soles
    "laced": ("laced", TRAINERS + LEATHERS),
    "boots": ("laced", LEATHERS),  # their shafts are the socks of other shoes
}
"""Garment and colours of each kind."""

HAIRCUTS: Final[Mapping[str, Mapping[str, int]]] = {
    "female": {"bob": 3, "long": 3, "ponytail": 3, "afro": 1, "short": 1, "": 0},
    "male": {"short": 4, "crop": 3, "afro": 1, "": 1, "long": 0, "ponytail": 0},
}
"""Garments of hair with their frequencies; "" is none."""


OUTFIT_TEXT: Final = f"{', '.join(OUTFITS)}, or {BARE}: the bare body; absent: as its seed has it"
"""Allowed names of outfits."""


@dataclass(frozen=True)
class Look:
    """A person's clothes."""

    outfit: str  # its name, or BARE
    garments: tuple[str, ...]  # of the wardrobe: clothes, shoes, hair
    colours: tuple[str, ...]  # sRGB, "#rrggbb", of each region

    @property
    def linear(self) -> Array:
        """Linear light of each region, [12, 3]."""
        codes = [[int(code[k : k + 2], 16) for k in (1, 3, 5)] for code in self.colours]
        return linear_colours(np.array(codes) / 255)


def look(style: int, gender: str, outfit: str = "") -> Look:
    """The look of a seed. `outfit`: a name, BARE, or "" for the seed's own.

    Colours of skin, hair and shoes do not depend on the outfit. Raises InvalidArgument.
    """
    check_outfit(outfit)
    rng = np.random.default_rng(style)

    def one(choices: Sequence[str]) -> str:
        return choices[int(rng.integers(len(choices)))]

    def weighted(shares: Mapping[str, int]) -> str:
        at = rng.integers(sum(shares.values()))
        return list(shares)[int(np.searchsorted(np.cumsum([*shares.values()]), at, "right"))]

    people = gender if gender in HAIRCUTS else "female"
    colours = dict.fromkeys(range(len(REGIONS)), "#808080")
    colours |= {SKIN: one(SKINS), HAIR: one(HAIRS), EYES: "#4a3c34", EYEBALLS: "#ddd8d0"}
    hair = weighted(HAIRCUTS[people])
    own = weighted({name: found.share[people] for name, found in OUTFITS.items()})
    name = outfit or own
    if name == BARE:
        return Look(BARE, (), tuple(colours.values()))
    worn = OUTFITS[name]
    shoes = one(worn.shoes)
    garment, leather = SHOE_KINDS[shoes]
    for region, palette in worn.colours.items():
        colours[region] = one(palette)
    colours |= {SHOES: one(leather), SOCKS: one(("#2a2b30", "#55585f", "#d8d5ce"))}
    if name == "suit":
        colours[TROUSERS] = colours[JACKET]
    if name == "skirt":
        colours[SOCKS] = colours[SKIN]
    colours[SOLES] = "#e6e3dc" if shoes == "trainers" else "#1c1a19"
    if shoes == "boots":
        colours[SOCKS] = colours[SHOES]
    garments = tuple(part for part in (worn.garments[people], garment, "brows", hair) if part)
    return Look(name, garments, tuple(colours.values()))


def check_outfit(name: str) -> str:
    """The name of an outfit, BARE or "". Raises InvalidArgument with the known ones."""
    if name and name != BARE and name not in OUTFITS:
        allowed = ", ".join(OUTFITS)
        raise InvalidArgument(
            f"there is no outfit {name!r}; there are {allowed}, and {BARE} for the bare body",
            "outfit",
        )
    return name


def regions(body: BodyModel) -> NDArray[np.int64]:
    """Region of each vertex [V]: the body's own, or that of the joint that moves it most."""
    if body.regions is not None:
        return body.regions.astype(np.int64)
    names = np.array(body.joint_names)
    by_joint = np.full(len(names), SKIN)
    for region, parts in {
        SHIRT: ("spine1", "spine2", "spine3", "collar", "shoulder"),
        TROUSERS: ("pelvis", "hip", "knee"),
        SHOES: ("ankle", "foot"),
    }.items():
        for part in parts:
            by_joint[[part in name for name in names]] = region
    owner = np.take_along_axis(body.skin_joints, body.skin_weights.argmax(-1)[:, None], -1)[:, 0]
    return by_joint[owner]


def linear_colours(srgb: Array) -> Array:
    """Converts sRGB to linear light (IEC 61966-2-1), as used in glTF's factors."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
