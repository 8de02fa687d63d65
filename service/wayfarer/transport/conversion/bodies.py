"""The bodies that a server offers: one body model, both genders."""

from collections.abc import Mapping
from dataclasses import dataclass

from wayfarer.body.library import Detail, load_body
from wayfarer.body.model import Array, BodyModel
from wayfarer.body.phenotype import betas_from_phenotype, height_of
from wayfarer.body.proportions import BodyFit, fit_betas
from wayfarer.spec import BETAS


@dataclass(frozen=True)
class BodyLibrary:
    """The bodies of one body model. `name`: of the model, for example "anny52"."""

    name: str

    def model(self, gender: str, detail: Detail = "high") -> BodyModel:
        """Returns the body of a gender. Raises NotFound, ArtifactError."""
        return load_body(self.name, gender, detail)

    def betas(self, gender: str, phenotype: Mapping[str, float]) -> Array:
        """Shape coefficients [10] for height_m, weight, muscle, age; a missing one takes the mean.

        Raises InvalidArgument whose `field` is one of these names.
        """
        height = phenotype.get("height_m", height_of(gender, (0.0,) * BETAS, self.name))
        return betas_from_phenotype(gender, **{**phenotype, "height_m": height})

    def fit(self, joints: Mapping[str, Array], floor: float | None, gender: str | None) -> BodyFit:
        """See `fit_betas`."""
        return fit_betas(joints, floor, gender, self.name)
