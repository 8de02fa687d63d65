class_name WayfarerSoles
extends RefCounted
## Soles of a character, from its mesh at rest: clients/README.md, "Retargeting", 5.

## Outermost points are looked for in these directions: degrees off straight down.
const _STEEP: Array[float] = [45.0, 75.0]
const _ROUND := 8  # number of directions around the vertical, for each

## Height of the lowest point that may touch the ground, in the basis.
var floor_height := INF
## Points that the ankle of each foot moves, from the ankle's joint.
var fixed: Array[PackedVector3Array] = []
## Points that the toes of each foot move, from the toes' joint.
var toes: Array[PackedVector3Array] = []


## The soles of a character. `places` are its mesh's vertices at rest, in its own space; `nodes` are
## the nodes of the rig that move each most. Null: a foot has no vertices, or they end above its
## ankle.
static func measure(
	map: WayfarerBoneMap,
	places: PackedVector3Array,
	nodes: PackedInt32Array,
	basis: WayfarerBasis = WayfarerBasis.new()
) -> WayfarerSoles:
	var turn := WayfarerCharacterJoints.new(map, basis).turn
	var owner := PackedInt32Array()
	for k in map.rig.names.size():
		var parent := map.rig.parents[k]
		var bone: Variant = map.bones.find_key(k)
		if bone != null:
			owner.append(WayfarerBones.NAMES.find(bone))
		else:
			owner.append(owner[parent] if parent >= 0 else -1)
	var directions := _directions(basis)
	var soles := WayfarerSoles.new()
	for leg in WayfarerRetarget.LEGS:
		for part in 2:
			var found := PackedVector3Array()
			var bone: int = leg[2 + part]
			if map.node(bone) >= 0:
				found = soles._outermost(places, nodes, owner, bone, turn, directions, basis.up)
				var joint := turn * map.rig.places[map.node(bone)]
				for k in found.size():
					found[k] -= joint
			if part == 0:
				soles.fixed.append(found)
			else:
				soles.toes.append(found)
		var ankle := (turn * map.rig.places[map.node(leg[2])]).dot(basis.up)
		var none: bool = soles.fixed[-1].is_empty() and soles.toes[-1].is_empty()
		if none or soles.floor_height >= ankle:
			return null
	return soles


## The vertices that a bone moves which are farthest in each direction.
func _outermost(
	places: PackedVector3Array,
	nodes: PackedInt32Array,
	owner: PackedInt32Array,
	bone: int,
	turn: Quaternion,
	directions: PackedVector3Array,
	up: Vector3
) -> PackedVector3Array:
	var best := PackedFloat64Array()
	var which := PackedInt32Array()
	best.resize(directions.size())
	best.fill(-INF)
	which.resize(directions.size())
	which.fill(-1)
	for k in nodes.size():
		if owner[nodes[k]] != bone:
			continue
		var place := turn * places[k]
		floor_height = minf(floor_height, place.dot(up))
		for d in directions.size():
			var far := place.dot(directions[d])
			if far > best[d]:
				best[d] = far
				which[d] = k
	var found := PackedVector3Array()
	var known: Dictionary[int, bool] = {-1: true}
	for k in which:
		if not known.has(k):
			known[k] = true
			found.append(turn * places[k])
	return found


## Directions down, and obliquely down all around.
static func _directions(basis: WayfarerBasis) -> PackedVector3Array:
	var found := PackedVector3Array([-basis.up])
	for degrees in _STEEP:
		var steep := deg_to_rad(degrees)
		for k in _ROUND:
			var angle := TAU * k / _ROUND
			var beside := cos(angle) * basis.forward + sin(angle) * basis.left
			found.append(sin(steep) * beside - cos(steep) * basis.up)
	return found
