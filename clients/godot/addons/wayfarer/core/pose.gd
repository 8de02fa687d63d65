class_name WayfarerPose
extends RefCounted
## A frame: the place of the hips, and rotations. Those of the hips are in the world, others local
## to the parent.

var hips := Vector3.ZERO
var turns: Array[Quaternion] = []


func _init(bones: int = 0) -> void:
	turns.resize(bones)
	turns.fill(Quaternion.IDENTITY)


func copy_from(other: WayfarerPose) -> void:
	hips = other.hips
	turns.assign(other.turns)


## Become the interpolation of two poses: hips on a line, rotations along the shorter arc.
func mix(a: WayfarerPose, b: WayfarerPose, share: float) -> void:
	hips = a.hips.lerp(b.hips, share)
	for k in turns.size():
		turns[k] = a.turns[k].slerp(b.turns[k], share).normalized()
