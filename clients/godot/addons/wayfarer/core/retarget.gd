class_name WayfarerRetarget
extends RefCounted
## Turns frames of an agent into poses of a character of any skeleton: clients/README.md,
## "Retargeting". Nothing here knows the axes of the character's bones: its T-pose follows from the
## places of its joints.

## Hip, knee, ankle, foot of the left and of the right leg.
const LEGS: Array[Array] = [[1, 4, 7, 10], [2, 5, 8, 11]]
const _ARMS: Array[Array] = [[16, 18, 20], [17, 19, 21]]
const _REACH := 0.999  # maximum stretch of a leg, as a share of its length
## Maximum that hips sink for a standing foot to reach its print, as a share of the leg's length.
const _SINKS := 0.018
## Heights of a sole over the ground by the leg's length: hips sink and a heel rises by all that a
## foot lacks while it is below the first, by nothing when it is above the second.
const _STANDS := 0.02
const _LEAVES := 0.06
## Radians: how far a heel rises at most for a foot to reach its print.
const _TIPTOE := 0.25
## Radians: how far toes turn up at most where a shoe is longer than the agent's foot.
const _FLEX := 0.5
const _BEND := 0.1  # of the thigh's length: a knee that bends less than this bends forwards
const _HEEL := 0.34  # of the way from ankle to ball: how far the heel is behind the ankle
const _TIP := 0.38  # of the way from ankle to ball: how far the tip is before the ball

var map: WayfarerBoneMap
var basis: WayfarerBasis
## Numbers of the bones that the character has, parents first.
var mapped := PackedInt32Array()
## Height of the character's thigh joints by that of the agent's.
var ratio := 1.0
## Height of the ground below the last pose.
var ground := 0.0
## Rotations and places of the bones' nodes in the world, by number of the bone.
var rotations: Array[Quaternion] = []
var places := PackedVector3Array()
## Relative to the nodes' parents.
var local: Array[Quaternion] = []
## Bones whose places must be set, too: the hips, and bones that hang from another bone than they
## follow.
var loose := PackedInt32Array()
## Places of their nodes relative to the nodes' parents, by number of the bone.
var moved := PackedVector3Array()
## Place of the hips' node relative to its parent.
var hips := Vector3.ZERO

var _up: Vector3
var _above := PackedInt32Array()  # the bone that each follows
var _hangs := PackedInt32Array()  # the bone that each one's node hangs from in the file; -1: none
var _rest: Array[Quaternion] = []  # of each node in the T-pose
var _offset := PackedVector3Array()  # of each bone, in the axes of the one above
# of each node's parent, in the axes of the bone that it hangs from
var _parent_turn: Array[Quaternion] = []
var _parent_place := PackedVector3Array()
var _parent_scale := PackedVector3Array()
var _source_offset := PackedVector3Array()  # of the agent
var _thighs := Vector3.ZERO  # the middle of the thigh joints from the hips' node, in its axes
var _soles: Array[Sole] = []
var _source_soles: Array[Sole] = []
var _stance := PackedVector3Array()
## Farthest and lowest reach of each foot's toes, from their joint.
var _tips := PackedVector3Array()
## Lengths of the legs, from thigh joint to ankle along the bones: the character's, and the agent's.
var _lengths := PackedFloat64Array()
var _source_lengths := PackedFloat64Array()
var _turns: Array[Quaternion] = []  # of the agent, in the world
var _source := PackedVector3Array()


## `rest_offsets` of the agent, three numbers a bone, in the stream's basis and unit, as is the
## character's own space. `floor_height`: of its soles at rest; NAN: 0, or below its feet.
## `soles`: found in its mesh.
func _init(
	bone_map: WayfarerBoneMap,
	rest_offsets: PackedFloat64Array,
	of_basis: WayfarerBasis = WayfarerBasis.new(),
	floor_height: float = NAN,
	soles: WayfarerSoles = null
) -> void:
	assert(rest_offsets.size() >= 3 * WayfarerBones.COUNT, "rest offsets of 22 bones are needed")
	assert(bone_map.error == "", bone_map.error)
	map = bone_map
	basis = of_basis
	_up = basis.up
	for b in WayfarerBones.COUNT:
		var at := 3 * b
		_source_offset.append(
			Vector3(rest_offsets[at], rest_offsets[at + 1], rest_offsets[at + 2])
		)
		if map.node(b) >= 0:
			mapped.append(b)
	rotations = _no_turns()
	local = _no_turns()
	_rest = _no_turns()
	_parent_turn = _no_turns()
	_parent_place.resize(WayfarerBones.COUNT)
	_parent_scale.resize(WayfarerBones.COUNT)
	moved.resize(WayfarerBones.COUNT)
	_turns = _no_turns()
	places.resize(WayfarerBones.COUNT)
	_offset.resize(WayfarerBones.COUNT)
	_source.resize(WayfarerBones.COUNT)
	_above.resize(WayfarerBones.COUNT)
	_hangs.resize(WayfarerBones.COUNT)
	_find_rest(floor_height, soles)


static func _no_turns() -> Array[Quaternion]:
	var turns: Array[Quaternion] = []
	turns.resize(WayfarerBones.COUNT)
	turns.fill(Quaternion.IDENTITY)
	return turns


## The bone that a bone's node hangs from in the file; -1: none.
func hangs(bone: int) -> int:
	return _hangs[bone]


## A frame of the stream on the character: fills rotations, places, local and hips. `at_ground`:
## height of the ground there; NAN: that of the lower sole.
func pose(frame: WayfarerPose, at_ground: float = NAN) -> void:
	_find_agent(frame)
	var clear := PackedFloat64Array()
	for leg in 2:
		var low := _lowest(_source_soles[leg], leg)
		clear.append(_source[LEGS[leg][2]].dot(_up) + low)
		_flex(leg, low)
	ground = minf(clear[0], clear[1]) if is_nan(at_ground) else at_ground
	for b in mapped:
		rotations[b] = _turns[b] * _rest[b]
	var thighs := _middle(_source)
	var lifted := ground + (thighs.dot(_up) - ground) * ratio
	places[0] = basis.level(thighs) + lifted * _up - rotations[0] * _thighs
	_put()
	var goals := PackedVector3Array()
	var most := PackedFloat64Array()
	var stays := PackedFloat64Array()  # 1 for a foot on the ground, 0 for one that has left it
	var sunk := 0.0
	for leg in 2:
		var high := maxf(0.0, clear[leg] - ground) * ratio
		goals.append(_goal(leg, ground + high))
		most.append(_reach(leg, goals[leg]))
		stays.append(clampf((_LEAVES - high / _lengths[leg]) / (_LEAVES - _STANDS), 0.0, 1.0))
		sunk = maxf(sunk, _lacks(leg, goals[leg], most[leg], stays[leg]))
	for b in mapped:
		places[b] -= sunk * _up
	for leg in 2:
		_bend(leg, _raised(leg, goals[leg], most[leg], stays[leg]), most[leg])
	_put()
	_relate()


func _find_rest(floor_height: float, soles: WayfarerSoles) -> void:
	var rig := map.rig
	var joints := WayfarerCharacterJoints.new(map, basis)
	var at_rest: Dictionary[int, Quaternion] = {}
	for b in mapped:
		at_rest[b] = joints.turn * rig.rotations[map.node(b)]
		_above[b] = WayfarerBones.PARENTS[b]
		while _above[b] >= 0 and map.node(_above[b]) < 0:
			_above[b] = WayfarerBones.PARENTS[_above[b]]
		_hangs[b] = -1
		for node in rig.ancestors(map.node(b)):
			var bone: Variant = map.bones.find_key(node)
			if bone != null:
				_hangs[b] = WayfarerBones.NAMES.find(bone)
				break
		if b == 0 or _hangs[b] != _above[b]:
			loose.append(b)
	var place := joints.places
	var correct := _corrections(place)
	for b in mapped:
		_rest[b] = correct[b] * at_rest[b]
		if _above[b] >= 0:
			var a := _above[b]
			_offset[b] = at_rest[a].inverse() * (place[b] - place[a])
		var parent := rig.parents[map.node(b)]
		_parent_scale[b] = Vector3.ONE
		if parent < 0:
			continue
		_parent_turn[b] = rig.rotations[parent]
		_parent_place[b] = rig.places[parent]
		_parent_scale[b] = rig.scales[parent]
		if _hangs[b] >= 0:
			var node := map.node(_hangs[b])
			var back := rig.rotations[node].inverse()
			_parent_turn[b] = back * _parent_turn[b]
			_parent_place[b] = back * (_parent_place[b] - rig.places[node])
	_thighs = at_rest[0].inverse() * (_middle(place) - place[0])
	_find_legs(joints, correct, floor_height, soles)


## The middle of the thigh joints: where the pelvis is. A rig's hips joint lies anywhere around it.
static func _middle(place: Variant) -> Vector3:
	return (place[LEGS[0][0]] + place[LEGS[1][0]]) / 2.0


## What turns each bone from the character's rest pose into a T-pose.
func _corrections(place: Dictionary[int, Vector3]) -> Dictionary[int, Quaternion]:
	var aims: Dictionary[int, Array] = {}
	for s in 2:
		var side := basis.left if s == 0 else -basis.left
		for n in 2:
			aims[LEGS[s][n]] = [LEGS[s][n + 1], -_up]
			aims[_ARMS[s][n]] = [_ARMS[s][n + 1], side]
	var correct: Dictionary[int, Quaternion] = {}
	for b in mapped:
		var turn: Quaternion = correct.get(_above[b], Quaternion.IDENTITY)
		if aims.has(b) and place.has(aims[b][0]):
			var limb := turn * (place[aims[b][0]] - place[b])
			turn = arc(limb, aims[b][1]) * turn
		correct[b] = turn
	for leg in LEGS:  # soles stay level: feet only turn to the front
		var ankle: int = leg[2]
		var toe: int = leg[3]
		var ahead := basis.forward
		if place.has(toe):
			ahead = basis.level(place[toe] - place[ankle])
		correct[ankle] = arc(ahead, basis.forward)
		if place.has(toe):
			correct[toe] = correct[ankle]
	return correct


## Soles, stance, and the ratio of heights.
func _find_legs(
	joints: WayfarerCharacterJoints,
	correct: Dictionary[int, Quaternion],
	floor_height: float,
	soles: WayfarerSoles
) -> void:
	var place := joints.places
	var stand: Dictionary[int, Vector3] = {0: place[0]}  # joint places in the T-pose
	for b in mapped:
		if _above[b] >= 0:
			var a := _above[b]
			stand[b] = stand[a] + correct[a] * (place[b] - place[a])
	var source := PackedVector3Array()
	for b in WayfarerBones.COUNT:
		var above := source[WayfarerBones.PARENTS[b]] if b > 0 else Vector3.ZERO
		source.append(above + _source_offset[b])
	var legs := 0.0
	var source_legs := 0.0
	var sole := INF
	for leg in LEGS:
		legs += (stand[leg[0]] - stand[leg[2]]).dot(_up)
		source_legs += (source[leg[0]] - source[leg[2]]).dot(_up)
		sole = minf(sole, minf(source[leg[2]].dot(_up), source[leg[3]].dot(_up)))
	var scale := legs / source_legs
	if is_nan(floor_height):
		floor_height = joints.floor_height if soles == null else soles.floor_height
	if is_nan(floor_height):
		floor_height = joints.lowest - scale * sole
	var thighs := _middle(stand)
	var source_thighs := _middle(source)
	var high := 0.0
	for leg in LEGS:
		var ankle: int = leg[2]
		var toe: int = leg[3]
		var ball := source[toe] - source[ankle]
		_source_soles.append(_sole(ball, source[ankle].dot(_up)))
		var own := scale * ball  # without toes, where a foot of this size would have them
		if place.has(toe):
			own = correct[ankle] * (place[toe] - place[ankle])
		var height := place[ankle].dot(_up) - floor_height
		high += height / 2.0
		var foot := _sole(own, height)
		if soles != null:
			var turn := correct[ankle]
			foot.joint = own
			foot.fixed = _turned(turn, soles.fixed[_soles.size()])
			foot.toes = PackedVector3Array()
			if place.has(toe):
				foot.toes = _turned(turn, soles.toes[_soles.size()])
		_soles.append(foot)
		var before := -INF
		var low := INF
		for point in foot.toes:
			before = maxf(before, point.dot(basis.forward))
			low = minf(low, point.dot(_up))
		var tip := before * basis.forward + low * _up
		_tips.append(Vector3.ZERO if foot.toes.is_empty() else tip)
		_lengths.append(_offset[leg[1]].length() + _offset[ankle].length())
		_source_lengths.append(_source_offset[leg[1]].length() + _source_offset[ankle].length())
		var beside: Vector3 = stand[ankle] + own - thighs - (source[toe] - source_thighs)
		_stance.append(beside.dot(basis.left) * basis.left)
	ratio = (legs / 2.0 + high) / source_thighs.dot(_up)


## A foot of which only the joints are known: the toes' from the ankle, which is at this height.
func _sole(toe: Vector3, height: float) -> Sole:
	var ahead := basis.level(toe)
	var foot := Sole.new()
	foot.ball = ahead - height * _up
	foot.heel = -_HEEL * ahead - height * _up
	foot.joint = toe
	foot.fixed = PackedVector3Array([foot.heel, foot.ball])
	foot.toes = PackedVector3Array([foot.ball - toe, foot.ball - toe + _TIP * ahead])
	return foot


static func _turned(turn: Quaternion, points: PackedVector3Array) -> PackedVector3Array:
	var turned := PackedVector3Array()
	for point in points:
		turned.append(turn * point)
	return turned


## Rotations and places of the agent's bones in the world.
func _find_agent(frame: WayfarerPose) -> void:
	_turns[0] = frame.turns[0].normalized()
	_source[0] = frame.hips
	for b in range(1, WayfarerBones.COUNT):
		var parent := WayfarerBones.PARENTS[b]
		_turns[b] = (_turns[parent] * frame.turns[b]).normalized()
		_source[b] = _source[parent] + _turns[parent] * _source_offset[b]


## Height of the lowest point of a foot over its ankle.
func _lowest(sole: Sole, leg: int) -> float:
	var up := _turns[LEGS[leg][2]].inverse() * _up
	var low := INF
	for point in sole.fixed:
		low = minf(low, point.dot(up))
	var joint := sole.joint.dot(up)
	up = _turns[LEGS[leg][3]].inverse() * _up
	for point in sole.toes:
		low = minf(low, joint + point.dot(up))
	return low


## Places of the bones below the hips.
func _put() -> void:
	for b in mapped:
		if b > 0:
			var a := _above[b]
			places[b] = places[a] + rotations[a] * _offset[b]


## Where the ankle goes: the ball over the same point as the agent's, the sole at that height.
func _goal(leg: int, sole: float) -> Vector3:
	var ankle: int = LEGS[leg][2]
	var ahead := basis.level(_turns[ankle] * basis.forward)
	if ahead.length() < 0.1:  # it points straight down
		ahead = basis.level(_turns[0] * basis.forward)
	var print_at := _source[ankle] + _turns[ankle] * _source_soles[leg].ball
	var beside := arc(basis.forward, ahead) * _stance[leg]
	var goal := basis.level(print_at + beside - _turns[ankle] * _soles[leg].ball)
	return goal + (sole - _lowest(_soles[leg], leg)) * _up


## Turn up the toes of a long shoe, so that the ankle is as high over where it stands as the
## agent's, scaled; `low`: the agent's lowest point from its ankle.
func _flex(leg: int, low: float) -> void:
	var foot := _turns[LEGS[leg][2]]
	var toe: int = LEGS[leg][3]
	var sole := _soles[leg]
	var axis := -basis.handed * basis.level(foot * basis.left)
	if map.node(toe) < 0 or sole.toes.is_empty() or axis.length() < 0.1:
		return
	axis = axis.normalized()
	var stands := (ratio * _source_soles[leg].ball - sole.ball).dot(_up)
	var deep := minf(0.0, ratio * low - stands - (foot * sole.joint).dot(_up))
	var tip := _turns[toe] * _tips[leg]
	var high := tip.dot(_up)
	var rises := axis.cross(tip).dot(_up)
	var share := deep / maxf(sqrt(high * high + rises * rises), 1e-9)
	var angle := asin(maxf(-1.0, share)) - atan2(high, rises)
	var half := clampf(angle, 0.0, _FLEX) / 2.0
	var about := sin(half) * axis
	_turns[toe] = Quaternion(about.x, about.y, about.z, cos(half)) * _turns[toe]


## How far an ankle may be from its thigh joint: as straight as the agent's leg is, and from there
## smoothly less of what the goal asks for.
func _reach(leg: int, goal: Vector3) -> float:
	var hip: int = LEGS[leg][0]
	var agents := _source[LEGS[leg][2]].distance_to(_source[hip]) / _source_lengths[leg]
	var over := goal.distance_to(places[hip]) / _lengths[leg] - agents
	var room := maxf(_REACH - agents, 1e-6)
	var soft := agents + room * (1.0 - exp(-maxf(0.0, over) / room))
	return minf(_REACH, soft) * _lengths[leg]


## How far the hips must sink for a foot to reach its print.
func _lacks(leg: int, goal: Vector3, most: float, stays: float) -> float:
	var start := places[LEGS[leg][0]]
	var away := basis.level(goal - start).length()
	var lacking := (start - goal).dot(_up) - sqrt(maxf(0.0, most * most - away * away))
	return minf(_SINKS * _lengths[leg], maxf(0.0, lacking) * stays)


## The goal with the heel up so far that the leg reaches it: the foot turns about its ball, as far
## as the ball bears it.
func _raised(leg: int, goal: Vector3, most: float, stays: float) -> Vector3:
	var ankle: int = LEGS[leg][2]
	var start := places[LEGS[leg][0]]
	var heel := _turns[ankle] * _soles[leg].heel
	var ball := _turns[ankle] * _soles[leg].ball
	var axis := basis.level(_turns[ankle] * basis.left).normalized()
	var raises := ball.cross(axis)  # which way the ankle goes
	if raises.dot(_up) < 0.0:
		axis = -axis
		raises = -raises
	var thigh := start - goal - ball  # from the ball
	var aside := axis.dot(ball) * axis
	var near := thigh.dot(aside - ball)
	var ahead := thigh.dot(raises)
	var square := thigh.length_squared() + ball.length_squared()
	var wanted := (square - most * most) / 2.0 + thigh.dot(aside)
	var share := wanted / maxf(sqrt(near * near + ahead * ahead), 1e-9)
	var lacking := atan2(ahead, near) - acos(clampf(share, -1.0, 1.0))
	var bears := clampf(1.0 - (ball - heel).dot(_up) / (_STANDS * _lengths[leg]), 0.0, 1.0)
	var half := stays * bears * clampf(lacking, 0.0, _TIPTOE) / 2.0
	var about := sin(half) * axis
	var turn := Quaternion(about.x, about.y, about.z, cos(half))
	rotations[ankle] = turn * rotations[ankle]
	return goal + ball - turn * ball


## Turn thigh and shin so that the ankle is at the goal, or as near as the leg reaches.
func _bend(leg: int, goal: Vector3, most: float) -> void:
	var hip: int = LEGS[leg][0]
	var knee: int = LEGS[leg][1]
	var ankle: int = LEGS[leg][2]
	var start := places[hip]
	var bend := places[knee] - start
	var shank := places[ankle] - places[knee]
	var thigh := bend.length()
	var shin := shank.length()
	goal = _within(start, goal, most, 1.001 * absf(thigh - shin))
	var far := start.distance_to(goal)
	var along := (goal - start) / far
	var side := bend - bend.dot(along) * along
	var front := _turns[hip] * basis.forward
	front -= front.dot(along) * along
	front /= maxf(front.length(), 1e-6)
	side += maxf(0.0, _BEND * thigh - side.dot(front)) * front
	side /= maxf(side.length(), 1e-9)
	var reach := (thigh * thigh + far * far - shin * shin) / (2.0 * far)
	var knee_at := reach * along + sqrt(maxf(0.0, thigh * thigh - reach * reach)) * side
	rotations[hip] = arc(bend, knee_at) * rotations[hip]
	rotations[knee] = arc(shank, goal - start - knee_at) * rotations[knee]


## A place that the leg reaches: at the goal's height, if it can, nearer to the hip.
func _within(start: Vector3, goal: Vector3, most: float, least: float) -> Vector3:
	var down := (goal - start).dot(_up)
	var away := basis.level(goal - start)
	var wide := away.length()
	if sqrt(down * down + wide * wide) > most:
		down = clampf(down, -most, most)
		away *= sqrt(most * most - down * down) / maxf(wide, 1e-9)
	elif sqrt(down * down + wide * wide) < least:
		return start - least * _up
	return start + away + down * _up


## Rotations relative to the nodes' parents, and places of loose bones.
func _relate() -> void:
	for b in mapped:
		var a := _hangs[b]
		var turn := _parent_turn[b]
		var place := _parent_place[b]
		if a >= 0:
			turn = rotations[a] * turn
			place = places[a] + rotations[a] * place
		local[b] = turn.inverse() * rotations[b]
		if b == 0 or a != _above[b]:
			moved[b] = (turn.inverse() * (places[b] - place)) / _parent_scale[b]
	hips = moved[0]


## The least rotation that turns the direction of a into that of b.
static func arc(a: Vector3, b: Vector3) -> Quaternion:
	var n := a.length() * b.length()
	var w := 1.0 + a.dot(b) / n
	if w < 1e-6:  # opposite: about any axis across (as near as numbers of 32 bits tell)
		var least := a.abs().min_axis_index()
		var other := Vector3.ZERO
		other[least] = 1.0
		var axis := a.cross(other).normalized()
		return Quaternion(axis.x, axis.y, axis.z, 0.0)
	var across := a.cross(b) / n
	return Quaternion(across.x, across.y, across.z, w).normalized()


## A foot in the T-pose, from the ankle's joint.
class Sole:
	var ball: Vector3  # on the ground
	var heel: Vector3  # on the ground
	var joint: Vector3  # about which the toes turn
	var fixed := PackedVector3Array()  # points that turn with the ankle
	var toes := PackedVector3Array()  # points that turn with the toes, from `joint`
