class_name WayfarerBones
extends RefCounted
## The 22 bones of a stream's profile "body", in order; parents come first.

const COUNT := 22
const NAMES: Array[String] = [
	"pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle",
	"right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar",
	"head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_wrist",
	"right_wrist",
]
## Number of each bone's parent; -1: none.
const PARENTS: Array[int] = [
	-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19
]
