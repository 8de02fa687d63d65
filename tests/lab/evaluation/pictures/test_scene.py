import numpy as np
import pytest

from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.pictures.camera import Camera, View
from wayfarer_lab.evaluation.pictures.floor import Mark, ring
from wayfarer_lab.evaluation.pictures.scene import ClipActor, picture

VIEW = View(azimuth=0.5, elevation=0.3, distance=5.0, metres=2.3, size=(120, 120))
CAMERA = Camera(VIEW, (0.0, 0.0, 0.9))


def darker(pixels, shown, empty):
    """Mask of pixels that are clearly darker than the empty floor."""
    return (pixels(empty) - pixels(shown)).sum(-1) > 30


def test_a_body_and_its_shadow_are_drawn_inside_the_picture(act, pixels):
    empty = picture(CAMERA, [])
    found = darker(pixels, picture(CAMERA, [(act(), 0)]), empty)
    assert 0.05 < found.mean() < 0.5
    rim = np.concatenate([found[0], found[-1], found[:, 0]])
    assert not rim.any(), "the body is cut off"


def test_the_shadow_leaves_the_feet_when_they_leave_the_floor(act, pixels):
    """Under a sole that stands, the floor is dark; under one in the air it is lit."""
    low = Camera(View(0.5, 0.9, 5.0, 0.8, (160, 160)), (0.0, 0.0, 0.0))
    standing = picture(low, [(act(), 0)])
    floating = picture(low, [(act(by=(0, 0, 0.15)), 0)])
    # the soles in the floating picture are higher up; compare the floor where they stood
    place = low.project(np.array([0.0, -0.13, 0.0]))[:2].round().astype(int)  # behind the heels
    around = (slice(place[1] - 6, place[1] + 7), slice(place[0] - 25, place[0] + 26))
    assert pixels(standing)[around].min(0).mean() < pixels(floating)[around].min(0).mean()


@pytest.mark.parametrize(("sink", "red"), [(0.0, False), (0.005, False), (0.06, True)])
def test_what_is_under_the_floor_is_red(act, pixels, sink, red):
    r, g, b = np.moveaxis(
        pixels(picture(CAMERA, [(act(by=(0, 0, -sink), look="dressed"), 0)])), -1, 0
    )
    assert ((r > 160) & (r > 2 * g) & (r > 2 * b)).any() == red


def test_the_nearer_person_hides_the_other(act, pixels):
    ahead = VIEW.axes[2] * [1, 1, 0]
    near, far = act(), act(by=tuple(ahead * 0.5), look="dressed")
    one = pixels(picture(CAMERA, [(far, 0), (near, 0)]))
    other = pixels(picture(CAMERA, [(near, 0), (far, 0)]))
    alone = pixels(picture(CAMERA, [(near, 0)]))
    assert abs(one - other).max() <= 1
    assert abs(one - alone)[60, 60].max() <= 1 and abs(one - alone).max() > 50


def test_marks_are_painted_on_the_floor_and_under_the_body(act, pixels):
    goal = ring((0.0, 0.0), 0.3, 0.05, "#00ff00")
    bare, marked = (pixels(picture(CAMERA, [(act(), 0)], marks)) for marks in ([], [goal]))
    changed = np.argwhere((bare != marked).any(-1))
    assert len(changed) > 20
    seen = CAMERA.project(np.array([[0.4, 0, 0], [-0.4, 0, 0], [0, 0.4, 0], [0, -0.4, 0]]))
    assert (changed >= seen[:, 1::-1].min(0) - 2).all()
    assert (changed <= seen[:, 1::-1].max(0) + 2).all()


def test_of_a_trail_that_begins_behind_the_camera_the_rest_is_seen(pixels):
    ahead = VIEW.axes[2, :2] / np.linalg.norm(VIEW.axes[2, :2])
    way = np.linspace(-9, 1, 60)[:, None] * ahead
    trail = pixels(picture(CAMERA, [], [Mark(way, 0.05, "#5b6470")]))
    changed = (trail != pixels(picture(CAMERA, []))).any(-1)
    rows = np.flatnonzero(changed.any(1))
    end = CAMERA.project(np.append(ahead, 0.0))[1]
    assert rows[-1] == 119 and abs(rows[0] - end) < 4 and changed.mean() < 0.1


def test_the_floor_is_fixed_in_the_world(pixels):
    moved = Camera(VIEW, (1.0, 1.0, 0.9))  # by one line of the grid
    assert abs(pixels(picture(CAMERA, [])) - pixels(picture(moved, []))).max() <= 8
    between = Camera(VIEW, (0.1, 0.1, 0.9))
    assert abs(pixels(picture(CAMERA, [])) - pixels(picture(between, []))).max() > 8


def test_clothes_differ_by_style_and_sides_by_left_and_right(body, clip):
    styles = [ClipActor.of(clip, body, "dressed", style).dress.albedo for style in (1, 2)]
    assert not np.array_equal(*styles)
    sides = ClipActor.of(clip, body, "sides").dress
    hand = {side: body.joint_names.index(f"{side}_wrist") for side in ("left", "right")}
    owner = body.skin_joints[np.arange(len(body.skin_joints)), body.skin_weights.argmax(-1)]
    left, right = (sides.albedo[owner == hand[side]].mean(0) for side in ("left", "right"))
    assert left[0] > left[2] and right[2] > right[0]


def test_an_unknown_look_is_refused(body, clip):
    with pytest.raises(InvalidArgument, match="allowed: dressed, sides"):
        ClipActor.of(clip, body, "naked")
