"""An SMPL-X file of the real layout, made of the anny52 body."""

import numpy as np

from wayfarer.body import skeleton, smplx
from wayfarer.body.library import load_body
from wayfarer.body.rotation import GLTF_FROM_CORE

AXES = GLTF_FROM_CORE
BODY = skeleton.joint_names()[:22]
FILE_NAMES = (*BODY, *smplx.EXTRA_JOINTS, *skeleton.joint_names()[22:])
"""Joint order of SMPL-X files: jaw and eyes stand before the fingers."""


def regressor_for(vertices, joints):
    """Rows over the 12 nearest vertices that give each joint exactly and sum to 1."""
    rows = np.zeros((len(joints), len(vertices)))
    for row, joint in zip(rows, joints, strict=True):
        near = np.argsort(np.linalg.norm(vertices - joint, axis=-1))[:12]
        system = np.vstack([vertices[near].T, np.ones(12)])
        row[near] = np.linalg.pinv(system) @ [*joint, 1.0]
    return rows


def smplx_arrays():
    """An SMPL-X file made of the anny52 body: T-posed, Y up, origin near the head."""
    rng = np.random.default_rng(0)
    body = load_body("anny52", "female", "low")
    rest = dict(zip(body.joint_names, body.rest_joints(np.zeros(10)), strict=True))
    rest |= {name: rest["head"] + [0, 0.05, 0.02 * k] for k, name in enumerate(FILE_NAMES[22:25])}
    vertices = (body.rest_vertices(np.zeros(10)) - [0, 0, 1.5]) @ AXES.T
    joints = (np.array([rest[name] for name in FILE_NAMES]) - [0, 0, 1.5]) @ AXES.T
    weights = np.zeros((len(vertices), 55))
    columns = np.array([FILE_NAMES.index(name) for name in body.joint_names])
    rows = np.arange(len(vertices))[:, None]
    np.add.at(weights, (rows, columns[body.skin_joints]), body.skin_weights)
    parents = dict(zip(body.joint_names, [None, *body.parents[1:]], strict=True))
    tree = [
        FILE_NAMES.index(body.joint_names[parents[n]]) if parents.get(n) is not None else 15
        for n in FILE_NAMES
    ]
    return {
        "v_template": vertices,
        "shapedirs": rng.normal(0, 0.002, (len(vertices), 3, 20)),
        "posedirs": rng.normal(0, 0.002, (len(vertices), 3, 486)),
        "J_regressor": regressor_for(vertices, joints),
        "weights": weights,
        "kintree_table": np.array([[2**32 - 1, *tree[1:]], range(55)], dtype=np.uint32),
        "f": body.faces.astype(np.uint32),
        "hands_meanl": rng.normal(0, 0.2, 45),
        "hands_meanr": rng.normal(0, 0.2, 45),
        "hands_componentsl": rng.normal(0, 0.2, (45, 45)),
        "hands_componentsr": rng.normal(0, 0.2, (45, 45)),
        "part2num": np.array({"Global": 0}, dtype=object),  # the real files have such entries
    }
