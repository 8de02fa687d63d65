from math import pi

import numpy as np
import pytest

from wayfarer.body.rotation import quaternion_from_rotvec
from wayfarer_lab.evaluation.pictures.framing import (
    calm_way,
    close_up,
    following,
    way_heading,
    wide,
)

SIZE = (160, 90)


def test_the_heading_is_that_of_the_way_or_of_the_body_that_stays(act, clip):
    assert way_heading(act()) == pytest.approx(0.0)  # along +Y
    back = clip.translation * [1, -1, 1]
    assert abs(way_heading(act(translation=back))) == pytest.approx(pi)
    turned = clip.rotations.copy()
    turned[:, 0] = quaternion_from_rotvec(np.array([0, 0, 0.8]))
    still = np.tile(clip.translation[:1], (clip.frames, 1))
    assert way_heading(act(translation=still, rotations=turned)) == pytest.approx(0.8)


def test_from_the_side_people_walk_to_the_right(act):
    camera = close_up(act(), 0, "side", SIZE)
    behind, ahead = camera.project(np.array([[0, -0.3, 0.9], [0, 0.3, 0.9]]))
    assert ahead[0] > behind[0] and ahead[2] == pytest.approx(behind[2])


def test_in_front_people_come_nearer(act):
    camera = close_up(act(), 0, "front", SIZE)
    behind, ahead = camera.project(np.array([[0, -0.3, 0.9], [0, 0.3, 0.9]]))
    assert ahead[2] < behind[2]


def test_a_view_from_the_body_turns_with_it(act, clip):
    turned = clip.rotations.copy()
    turned[-1, 0] = quaternion_from_rotvec(np.array([0, 0, 1.0]))
    actor = act(rotations=turned)
    azimuths = [close_up(actor, frame, "body", SIZE).view.azimuth for frame in (0, -1)]
    assert azimuths[1] - azimuths[0] == pytest.approx(1.0)


def test_a_following_camera_keeps_the_body_near_the_middle(act):
    actor = act()
    cameras = following(actor, "quarter", SIZE)
    assert len(cameras) == actor.clip.frames
    places = [camera.project(hips)[0] for camera, hips in zip(cameras, actor.hips, strict=True)]
    assert max(abs(place - SIZE[0] / 2) for place in places) < SIZE[0] / 4


def test_a_calm_way_loses_sway_but_not_the_way():
    time = np.arange(0, 10, 1 / 40)
    hips = np.stack([0.05 * np.sin(2 * pi * time), 1.2 * time, 0 * time], -1)
    calm = calm_way(hips, 40.0)
    assert calm.shape == (400, 2)
    assert abs(calm[80:-80, 0]).max() < 0.005
    np.testing.assert_allclose(calm[80:-80, 1], hips[80:-80, 1], atol=1e-3)


def test_a_wide_camera_sees_every_way_from_sole_to_crown(act):
    actors = [act(), act(by=(7, 0, 0)), act(by=(-2, 9, 0))]
    camera = wide(actors, SIZE)
    feet = np.concatenate([actor.hips * [1, 1, 0] for actor in actors])
    seen = camera.project(np.concatenate([feet, feet + np.array([0, 0, 1.9])]))
    assert (seen[:, :2] >= 0).all() and (seen[:, :2] <= SIZE).all()
    assert np.ptp(seen[:, 0]) > 0.5 * SIZE[0], "people are not lost in the distance"
