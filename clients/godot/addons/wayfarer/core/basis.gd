class_name WayfarerBasis
extends RefCounted
## A basis that a session may choose (docs/wire-format.md): unit vectors of a body at heading 0.
## Godot's own is "gltf", right-handed and Y up; a body at heading 0 faces +Z.

const NAMES: Array[String] = ["gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros"]
const _AXES: Array[String] = ["+x+y+z", "-x+y+z", "-y+z+x", "+x+z+y", "+x+z-y", "+y+z+x"]

var name: String
var left: Vector3
var up: Vector3
var forward: Vector3
## 1 when the axes are right-handed, -1 when left-handed.
var handed: float


## "gltf", as in the API, or another of NAMES.
func _init(basis_name: String = "gltf") -> void:
	assert(basis_name in NAMES, "%s is no basis that this client knows" % basis_name)
	name = basis_name
	var axes := _AXES[NAMES.find(basis_name)]
	left = _axis(axes.substr(0, 2))
	up = _axis(axes.substr(2, 2))
	forward = _axis(axes.substr(4, 2))
	handed = left.cross(up).dot(forward)


## The angle about up by which a rotation turns forward, radians.
func heading_of(turn: Quaternion) -> float:
	var ahead := turn * forward
	# cross(up, forward), the same algebra in every basis
	return atan2(ahead.dot(up.cross(forward)), ahead.dot(forward))


## A vector without its part along up.
func level(vector: Vector3) -> Vector3:
	return vector - vector.dot(up) * up


static func _axis(text: String) -> Vector3:
	var sign_of := -1.0 if text[0] == "-" else 1.0
	return sign_of * {"x": Vector3.RIGHT, "y": Vector3.UP, "z": Vector3.BACK}[text[1]]
