"""A body as a skinned GLB (glTF 2.0 binary): browsers and engines load it once per agent.

The file is in the glTF basis (metres, Y up, facing +Z). Its node rest pose is the T-pose with
identity rotations, so a streamed pose is written to the joint nodes as it comes. The mesh stays in
its bind pose; the inverse bind matrices hold bind → rest, so skinning equals `BodyModel.skin`.
Pose blend shapes (SMPL-X) have no place in glTF and are left out.
"""

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import pygltflib as gltf
from numpy.typing import NDArray

from wayfarer import __version__
from wayfarer.body.mesh import split_vertices, vertex_normals
from wayfarer.body.model import BodyModel
from wayfarer.body.outfit import EYEBALLS, EYES, REGIONS, ROUGHNESS, SKIN, Look, look
from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.body.wardrobe import dressed

Array = NDArray[np.floating[Any]]

_COMPONENTS = {
    np.dtype(np.float32): gltf.FLOAT,
    np.dtype(np.uint8): gltf.UNSIGNED_BYTE,
    np.dtype(np.uint16): gltf.UNSIGNED_SHORT,
    np.dtype(np.uint32): gltf.UNSIGNED_INT,
}
_TYPES = {(): gltf.SCALAR, (2,): gltf.VEC2, (3,): gltf.VEC3, (4,): gltf.VEC4, (4, 4): gltf.MAT4}


class GlbFile:
    """A GLB under construction: the glTF document and its one binary buffer."""

    def __init__(self) -> None:
        self.document = gltf.GLTF2(
            asset=gltf.Asset(version="2.0", generator=f"wayfarer {__version__}")
        )
        self._blob = bytearray()

    def add(self, values: NDArray[Any], target: int | None = None, normalized: bool = False) -> int:
        """Appends an array as buffer view and accessor; returns the accessor's index.

        values [n, ...] of float32, uint8, uint16 or uint32. Matrices are stored by columns, as
        glTF wants. Bounds are written for floats, where glTF asks for some of them.
        """
        kind = _TYPES[values.shape[1:]]
        stored = np.swapaxes(values, -1, -2) if values.ndim == 3 else values
        self._blob.extend(b"\0" * (-len(self._blob) % 4))  # accessors start at multiples of 4
        document, data = self.document, np.ascontiguousarray(stored).tobytes()
        document.bufferViews.append(
            gltf.BufferView(
                buffer=0, byteOffset=len(self._blob), byteLength=len(data), target=target
            )
        )
        self._blob.extend(data)
        accessor = gltf.Accessor(
            bufferView=len(document.bufferViews) - 1,
            componentType=_COMPONENTS[values.dtype],
            count=len(values),
            type=kind,
            normalized=normalized,
        )
        if values.dtype == np.float32 and kind != gltf.MAT4:
            flat = values.reshape(len(values), -1)
            accessor.min, accessor.max = flat.min(0).tolist(), flat.max(0).tolist()
        document.accessors.append(accessor)
        return len(document.accessors) - 1

    def to_bytes(self) -> bytes:
        """The finished file. pygltflib would take longer than all the rest of a body."""
        self._blob.extend(b"\0" * (-len(self._blob) % 4))
        self.document.buffers = [gltf.Buffer(byteLength=len(self._blob))]
        text = json.dumps(_plain(self.document), separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        header = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(self._blob))
        chunks = [(text, b"JSON"), (bytes(self._blob), b"BIN\0")]
        return header + b"".join(
            struct.pack("<I4s", len(data), kind) + data for data, kind in chunks
        )


def _plain(value: Any) -> Any:
    """A part of a glTF document for JSON, without what is None or empty, except in extensions."""
    if isinstance(value, list):
        numbers = bool(value) and isinstance(value[0], (int, float))
        return value if numbers else [_plain(item) for item in value]
    named = value if isinstance(value, dict) else getattr(value, "__dict__", None)
    if named is None:
        return value
    parts = {
        name: part if name == "extensions" else _plain(part)
        for name, part in named.items()
        if not name.startswith("_")
    }
    return {name: part for name, part in parts.items() if part not in (None, [], {}, "")}


def body_glb(body: BodyModel, betas: Array, style: int = 0, outfit: str = "") -> bytes:
    """The body with this shape, standing in T-pose, in clothes that the seed `style` chooses.

    `outfit`: see `look`.

    Joint nodes carry the canonical joint names. Raises InvalidArgument on bad betas and
    outfits.
    """
    file = GlbFile()
    worn = look(style, body.gender, outfit)
    joints, mesh, _ = add_body(file, body, betas, worn)
    file.document.scenes.append(gltf.Scene(nodes=[joints[0], mesh]))
    file.document.scene = 0
    file.document.extras = about_body(body, betas, worn)
    return file.to_bytes()


def about_body(body: BodyModel, betas: Array, worn: Look) -> dict[str, Any]:
    """The `extras` of a file that describe a body in it."""
    betas = np.asarray(betas).tolist()
    return {"body": body.name, "gender": body.gender, "betas": betas, "outfit": worn.outfit}


def add_body(
    file: GlbFile,
    body: BodyModel,
    betas: Array,
    worn: Look,
    names: Sequence[str] | None = None,
    root: str = "",
) -> tuple[list[int], int, int]:
    """Adds joint nodes, mesh and skin; returns the nodes of the joints, of the mesh, of the top.

    `names`: of the joints; none: the canonical ones. `root`: name of a bone above the hips, at the
    origin, which moves no vertex. The nodes are in no scene yet.
    """
    shape = body.check_betas(betas)
    joints = add_joints(file, body, shape, names or body.joint_names)
    document = file.document
    top, bones, inverse = joints[0], list(joints), _inverse_bind(body, shape)
    if root:
        document.nodes.append(gltf.Node(name=root, children=[top]))
        top = len(document.nodes) - 1
        bones.append(top)
        inverse = np.concatenate([inverse, np.eye(4, dtype=np.float32)[None]])
    document.skins.append(
        gltf.Skin(joints=bones, skeleton=top, inverseBindMatrices=file.add(inverse))
    )
    document.meshes.append(_mesh(file, body, shape, worn))
    skin, mesh = len(document.skins) - 1, len(document.meshes) - 1
    document.nodes.append(gltf.Node(name="body", mesh=mesh, skin=skin))
    return joints, len(document.nodes) - 1, top


def add_joints(file: GlbFile, body: BodyModel, betas: Array, names: Sequence[str]) -> list[int]:
    """One node per joint, at its T-pose offset from its parent, unrotated."""
    first = len(file.document.nodes)
    rest = body.rest_joints(betas)
    offsets = rest.copy()
    offsets[1:] -= rest[body.parents[1:]]
    for name, offset in zip(names, offsets @ GLTF_FROM_CORE.T, strict=True):
        file.document.nodes.append(gltf.Node(name=name, translation=offset.tolist()))
    nodes = file.document.nodes
    for joint, parent in enumerate(body.parents[1:], start=1):
        nodes[first + parent].children.append(first + joint)
    return list(range(first, len(nodes)))


def _inverse_bind(body: BodyModel, betas: Array) -> NDArray[np.float32]:
    """Bind-pose mesh → joint, so that world = [R | p] · inverse_bind · vertex. [J, 4, 4].

    BodyModel.skin: v = R·B·(v_bind - j_bind) + p, so inverse_bind = [B | -B·j_bind].
    """
    joints = body.bind_joints + body.bind_joints_dirs @ betas  # [J, 3]
    matrices = np.tile(np.eye(4), (len(joints), 1, 1))
    turn = GLTF_FROM_CORE @ body.bind_to_rest
    matrices[:, :3, :3] = turn @ GLTF_FROM_CORE.T
    matrices[:, :3, 3] = -np.einsum("jab,jb->ja", turn, joints)
    return matrices.astype(np.float32)


def _mesh(file: GlbFile, body: BodyModel, betas: Array, clothes: Look) -> gltf.Mesh:
    """One primitive with a material for each region, such as skin, hair or shirt.

    Vertices are doubled where two regions meet, so that hems are crisp, and at texture seams.
    """
    body, worn = dressed(body, clothes)
    vertices = body.bind_vertices + body.bind_vertices_dirs @ betas
    normals = vertex_normals(vertices, body.faces)
    normals[np.linalg.norm(normals, axis=-1) < 0.5] = (0, 0, 1)  # tips of hair, thin as a line
    marks = [np.repeat(worn[:, None], 3, axis=1)]
    if body.uv_faces is not None:
        marks.append(body.uv_faces + 1)
    source, [region, *uv], faces = split_vertices(body.faces, *marks)
    colours = clothes.linear
    primitives = []
    for number in np.unique(worn).tolist():
        mine = np.flatnonzero(region == number)
        primitive = _primitive(file, body, source[mine], vertices, normals)
        if body.uvs is not None and (uv[0][mine] > 0).all():  # clothes have none
            uvs = (body.uvs[uv[0][mine] - 1] * 65_535).round().astype(np.uint16)
            primitive.attributes.TEXCOORD_0 = file.add(uvs, gltf.ARRAY_BUFFER, normalized=True)
        index = np.uint16 if len(mine) < 65_535 else np.uint32
        corners = np.searchsorted(mine, faces[worn == number]).reshape(-1).astype(index)
        primitive.indices = file.add(corners, gltf.ELEMENT_ARRAY_BUFFER)
        primitive.material = len(file.document.materials)
        surface = gltf.PbrMetallicRoughness(
            baseColorFactor=[*colours[number].tolist(), 1.0],
            metallicFactor=0.0,
            roughnessFactor=ROUGHNESS[number],
        )
        material = gltf.Material(
            name=REGIONS[number],
            pbrMetallicRoughness=surface,
            doubleSided=number not in (SKIN, EYES, EYEBALLS),  # the inside of a sleeve is visible
        )
        file.document.materials.append(material)
        primitives.append(primitive)
    return gltf.Mesh(name=body.name, primitives=primitives)


def _primitive(
    file: GlbFile, body: BodyModel, source: NDArray[np.int64], vertices: Array, normals: Array
) -> gltf.Primitive:
    """Places, normals and skin of the vertices [V'] that come from these vertices of the body."""
    weights = body.skin_weights[source].astype(np.float32)
    weights /= weights.sum(-1, keepdims=True)
    joints = np.where(weights > 0, body.skin_joints[source], 0)  # as the standard asks

    def vectors(values: Array) -> NDArray[np.float32]:
        return (values[source] @ GLTF_FROM_CORE.T).astype(np.float32)

    return gltf.Primitive(
        attributes=gltf.Attributes(
            POSITION=file.add(vectors(vertices), gltf.ARRAY_BUFFER),
            NORMAL=file.add(vectors(normals), gltf.ARRAY_BUFFER),
            JOINTS_0=file.add(joints.astype(np.uint8), gltf.ARRAY_BUFFER),
            WEIGHTS_0=file.add(weights, gltf.ARRAY_BUFFER),
        )
    )
