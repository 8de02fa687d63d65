"""A separate parser reads the file, and its joints are compared with the body's."""

import numpy as np
import pytest

from wayfarer.body.rotation import GLTF_FROM_CORE
from wayfarer.clips.actor import Actor
from wayfarer.clips.bvh import bvh_text, zxy_angles

AXES = {"X": 0, "Y": 1, "Z": 2}


def turn(axis, degrees):
    a, b = [(1, 2), (2, 0), (0, 1)][AXES[axis]]
    angle = np.radians(degrees)
    matrix = np.eye(3)
    matrix[a, a] = matrix[b, b] = np.cos(angle)
    matrix[a, b], matrix[b, a] = -np.sin(angle), np.sin(angle)
    return matrix


def parse(path):
    return parse_text(path.read_text())


def parse_text(text):
    """Joints in file order (name, parent, offset, channels), frames [N, C], frame time."""
    lines = [line.split() for line in text.splitlines()]
    joints, stack, row = [], [], 0
    while lines[row][0] != "MOTION":
        words = lines[row]
        if words[0] in ("ROOT", "JOINT", "End"):
            name = None if words[0] == "End" else words[1]
            joints.append([name, stack[-1] if stack else -1, None, []])
        elif words[0] == "{":
            stack.append(len(joints) - 1)
        elif words[0] == "}":
            stack.pop()
        elif words[0] == "OFFSET":
            joints[-1][2] = np.array(words[1:], float)
        elif words[0] == "CHANNELS":
            assert int(words[1]) == len(words) - 2
            joints[-1][3] = words[2:]
        row += 1
    assert not stack
    frames = np.array(lines[row + 3 :], float)
    assert len(frames) == int(lines[row + 1][1])
    return joints, frames, float(lines[row + 2][2])


def places(joints, values):
    """World place of each named joint by the rules of the format."""
    world, found, at = [], {}, 0
    for name, parent, offset, channels in joints:
        above = world[parent] if parent >= 0 else np.eye(4)
        local = np.eye(4)
        local[:3, 3] = offset
        for channel in channels:
            kind, axis = channel[1:], channel[0]
            if kind == "position":
                local[AXES[axis], 3] += values[at]
            else:
                local[:3, :3] = local[:3, :3] @ turn(axis, values[at])
            at += 1
        world.append(above @ local)
        if name:
            found[name] = world[-1][:3, 3]
    assert at == len(values)
    return found


@pytest.mark.parametrize("scale", [1.0, 100.0])
def test_joints_are_where_the_body_has_them(tmp_path, clip, body, scale):
    (tmp_path / "c.bvh").write_text(bvh_text(Actor(clip, body), "smpl", scale))
    joints, frames, frame_time = parse(tmp_path / "c.bvh")
    assert frame_time == pytest.approx(1 / clip.fps)
    assert len(frames) == clip.frames
    expected = clip.pose(body)[1] @ GLTF_FROM_CORE.T
    for frame in (0, 7, clip.frames - 1):
        found = places(joints, frames[frame])
        assert list(found) != [] and set(found) == set(body.joint_names[:22])
        for name, place in found.items():
            wanted = expected[frame, body.joint_names.index(name)]
            np.testing.assert_allclose(place / scale, wanted, atol=1e-4, err_msg=name)


def test_every_leaf_has_an_end_site_of_some_length(tmp_path, clip, body):
    (tmp_path / "c.bvh").write_text(bvh_text(Actor(clip, body)))
    joints, _, _ = parse(tmp_path / "c.bvh")
    parents = {parent for _, parent, _, _ in joints}
    leaves = [joint for i, joint in enumerate(joints) if i not in parents]
    assert len(leaves) == 5  # head, hands, feet
    for name, _, offset, _ in leaves:
        assert name is None
        assert np.linalg.norm(offset) > 0.02


def test_angles_at_the_gimbal_lock():
    for x in (90.0, -90.0):
        matrix = turn("Z", 35) @ turn("X", x) @ turn("Y", 20)
        z, x_found, y = np.degrees(zxy_angles(matrix))
        again = turn("Z", z) @ turn("X", x_found) @ turn("Y", y)
        np.testing.assert_allclose(again, matrix, atol=1e-6)
