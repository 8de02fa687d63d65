import numpy as np
from PIL import Image, ImageDraw

from wayfarer_lab.evaluation.pictures.chart import contact_lane, foot_chart, sole_vertices


def test_soles_are_under_the_feet_on_their_sides(body):
    left, right = sole_vertices(body)
    rest = body.rest_vertices(np.zeros(10))
    assert len(left) > 3 and len(right) > 3
    assert (rest[left, 0] < 0).all() and (rest[right, 0] > 0).all()
    assert rest[left, 2].max() < 0.05


def test_a_sliding_foot_and_a_lifted_one_change_the_curves(act, clip, pixels):
    still = np.tile(clip.translation[:1], (clip.frames, 1))
    standing = pixels(foot_chart(act(translation=still), 400))
    sliding = pixels(foot_chart(act(), 400))
    lifted = pixels(foot_chart(act(translation=still + np.array([0, 0, 0.08])), 400))
    speed, height = slice(100, 168), slice(8, 92)
    assert (standing[speed] != sliding[speed]).any()
    assert (standing[height] == sliding[height]).all()
    assert (standing[height] != lifted[height]).any()
    assert (standing[speed] == lifted[speed]).all()


def test_a_lane_is_filled_while_the_foot_touches():
    picture = Image.new("RGB", (102, 8), "#000000")
    flags = np.repeat([True, False, True], [25, 50, 25])
    contact_lane(ImageDraw.Draw(picture), flags, 0, 100, 2, "#ffffff")
    row = np.asarray(picture)[3, :, 0]
    assert row[:24].all() and not row[27:73].any() and row[77:99].all()
