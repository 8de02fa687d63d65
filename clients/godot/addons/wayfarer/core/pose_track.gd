class_name WayfarerPoseTrack
extends RefCounted
## The frames of one agent, and its pose at moments that never go back: clients/README.md,
## "Playout".

const BLEND := 0.2  # seconds to blend from a held pose to the stream again
const KEPT := 400  # most frames: a program in the background receives, but does not play

## How often frames ran out.
var underruns := 0
## Bits of the frame at or before the moment shown: 1 left foot, 2 right foot.
var contacts := 0
## Whether frames have run out, and the last one is shown.
var held := false

var _times := PackedFloat64Array()
var _poses: Array[WayfarerPose] = []
var _feet := PackedByteArray()
var _starving := false
var _held_pose: WayfarerPose  # to blend from
var _held_at := NAN  # when the blend began; NAN: there is none
var _shown: WayfarerPose


func _init(bones: int) -> void:
	_held_pose = WayfarerPose.new(bones)
	_shown = WayfarerPose.new(bones)


## Number of bones in a frame.
func bones() -> int:
	return _shown.turns.size()


## Number of frames in the queue.
func length() -> int:
	return _times.size()


## Add frames, the first of which is for `time`, with a byte of contacts each, from `at` on. Known
## ones are dropped.
func push(
	time: float, fps: float, poses: Array[WayfarerPose], feet: PackedByteArray, at: int = 0
) -> void:
	var last := -INF if _times.is_empty() else _times[-1]
	for k in poses.size():
		var when := time + k / fps
		if when <= last + 0.25 / fps:
			continue
		if _times.size() == KEPT:
			_drop()
		_times.append(when)
		_poses.append(poses[k])
		_feet.append(feet[at + k])


## Seconds of frames after `time`; negative when they have run out.
func buffered(time: float) -> float:
	return -INF if _times.is_empty() else _times[-1] - time


## Write the pose at `time` into `into`; false when no frame has come yet.
func sample(time: float, into: WayfarerPose) -> bool:
	if _times.is_empty():
		return false
	while _times.size() > 1 and _times[1] <= time:
		_drop()  # one frame before the time stays, to interpolate from
	held = _times.size() == 1 and time > _times[0]
	if held:
		underruns += 0 if _starving else 1
		_starving = true
	elif _starving and _times.size() > 1:
		_starving = false
		_held_pose.copy_from(_shown)
		_held_at = time
	if _times.size() == 1 or time <= _times[0]:
		into.copy_from(_poses[0])
	else:
		into.mix(_poses[0], _poses[1], (time - _times[0]) / (_times[1] - _times[0]))
	var share := (time - _held_at) / BLEND
	if share >= 1.0:
		_held_at = NAN
	elif not is_nan(share):
		into.mix(_held_pose, into, share * share * (3.0 - 2.0 * share))
	_shown.copy_from(into)
	contacts = _feet[0]
	return true


func _drop() -> void:
	_times.remove_at(0)
	_poses.remove_at(0)
	_feet.remove_at(0)
