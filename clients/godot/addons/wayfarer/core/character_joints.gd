class_name WayfarerCharacterJoints
extends RefCounted
## Joints of a character at rest, upright in the basis: the server's input to make an agent with its
## proportions (POST /v1/bodies:fit).

const _SNAP := 0.9063077870366499  # cos 25°: an axis this near to one of the file's is that axis

## Places of the joints by number of the bone.
var places: Dictionary[int, Vector3] = {}
## Height of its floor: the lowest point of its mesh, or 0 if its feet are close above the origin's
## level; otherwise NAN, unknown.
var floor_height := NAN
## Height of the lowest ankle or ball.
var lowest := INF
## The rotation from the character's axes to the basis.
var turn: Quaternion

var _basis: WayfarerBasis


func _init(map: WayfarerBoneMap, basis: WayfarerBasis, soles: WayfarerSoles = null) -> void:
	_basis = basis
	turn = _alignment(map)
	for b in WayfarerBones.COUNT:
		if map.node(b) >= 0:
			places[b] = turn * map.rig.places[map.node(b)]
	for leg in WayfarerRetarget.LEGS:
		for b: int in [leg[2], leg[3]]:
			if places.has(b):
				lowest = minf(lowest, places[b].dot(basis.up))
	var thighs := (places[1] + places[2]) / 2.0
	if soles != null:
		floor_height = soles.floor_height
	elif lowest >= 0.0 and lowest <= 0.25 * (thighs.dot(basis.up) - lowest):
		floor_height = 0.0


## Derives the rotation from its legs.
func _alignment(map: WayfarerBoneMap) -> Quaternion:
	var at := func(b: int) -> Vector3: return map.rig.places[map.node(b)]
	var legs := WayfarerRetarget.LEGS
	var thighs: Vector3 = at.call(legs[0][0]) + at.call(legs[1][0])
	var up := _snapped(thighs - at.call(legs[0][2]) - at.call(legs[1][2]))
	var across: Vector3 = at.call(legs[0][0]) - at.call(legs[1][0])
	var left := _snapped(across - across.dot(up) * up)
	left = (left - left.dot(up) * up).normalized()
	var forward := _basis.handed * left.cross(up)
	# columns are axes: of one handedness, so the product is a rotation
	var own := Basis(left, up, forward)
	var wanted := Basis(_basis.left, _basis.up, _basis.forward)
	return (wanted * own.transposed()).get_rotation_quaternion()


static func _snapped(direction: Vector3) -> Vector3:
	var unit := direction.normalized()
	var k := unit.abs().max_axis_index()
	if absf(unit[k]) < _SNAP:
		return unit
	var axis := Vector3.ZERO
	axis[k] = signf(unit[k])
	return axis
