class_name WayfarerRetarget
extends RefCounted
## Turns frames of an agent into poses of a character of any skeleton: clients/README.md,
## "Retargeting". Nothing here knows the axes of the character's bones: its T-pose follows from the
## places of its joints.

## Hip, knee, ankle, foot of the left and of the right leg.
const LEGS: Array[Array] = [[1, 4, 7, 10], [2, 5, 8, 11]]
const _ARMS: Array[Array] = [[16, 18, 20], [17, 19, 21]]
const _REACH := 0.999  # of a leg's length: how far it is stretched at most
## Of a leg's length: how far hips sink at most for a standing foot to reach its print.
const _SINKS := 0.018
## Heights of a sole over the ground by the leg's length: hips sink by all that a foot lacks while
## it is below the first, by nothing when it is above the second.
const _STANDS := 0.02
const _LEAVES := 0.06
## Radians: how far a heel rises at most for a foot to reach its print.
const _TIPTOE := 0.25
const _BEND := 0.1  # of the thigh's length: a knee that bends less than this bends forwards
const _HEEL := 0.35  # of the way from ankle to ball: how far the heel is behind the ankle
const _TIP := 0.45  # of the way from ankle to ball: how far the tip is before the ball

var map: WayfarerBoneMap
var basis: WayfarerBasis
## Numbers of the bones that the character has, parents first.
var mapped := PackedInt32Array()
## Height of the character's thigh joints by that of the agent's.
var ratio := 1.0
## Height of the ground that the last pose stands on.
var ground := 0.0
## Of the bones' nodes in the world, by number of the bone.
var rotations: Array[Quaternion] = []
var places := PackedVector3Array()
## Relative to the nodes' parents.
var local: Array[Quaternion] = []
## Place of the hips' node relative to its parent.
var hips := Vector3.ZERO

var _up: Vector3
var _above := PackedInt32Array()
var _rest: Array[Quaternion] = []  # of each node in the T-pose
var _offset := PackedVector3Array()  # of each bone, in the axes of the one above
var _gap: Array[Quaternion] = []  # rest rotation of the node's parent, by that of the bone above
var _source_offset := PackedVector3Array()  # of the agent
var _base_turn := Quaternion.IDENTITY  # what the hips' node hangs from
var _base_place := Vector3.ZERO
var _base_scale := Vector3.ONE
var _thighs := Vector3.ZERO  # the middle of the thigh joints from the hips' node, in its axes
var _soles: Array[PackedVector3Array] = []  # of a foot that stands: heel, ball, tip
var _source_soles: Array[PackedVector3Array] = []
var _stance := PackedVector3Array()
var _turns: Array[Quaternion] = []  # of the agent, in the world
var _source := PackedVector3Array()


## `rest_offsets` of the agent, three numbers a bone, in the stream's basis and unit, as is the
## character's own space; `floor_height`: of its soles at rest, NAN: 0, or below its feet.
func _init(
	bone_map: WayfarerBoneMap,
	rest_offsets: PackedFloat64Array,
	of_basis: WayfarerBasis = WayfarerBasis.new(),
	floor_height: float = NAN
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
	_gap = _no_turns()
	_turns = _no_turns()
	places.resize(WayfarerBones.COUNT)
	_offset.resize(WayfarerBones.COUNT)
	_source.resize(WayfarerBones.COUNT)
	_above.resize(WayfarerBones.COUNT)
	_find_rest(floor_height)


static func _no_turns() -> Array[Quaternion]:
	var turns: Array[Quaternion] = []
	turns.resize(WayfarerBones.COUNT)
	turns.fill(Quaternion.IDENTITY)
	return turns


## A frame of the stream on the character: fills rotations, places, local and hips. `at_ground`:
## height of the ground there; NAN: that of the lower sole.
func pose(frame: WayfarerPose, at_ground: float = NAN) -> void:
	_find_agent(frame)
	var clear := PackedFloat64Array()
	for leg in 2:
		clear.append(_source[LEGS[leg][2]].dot(_up) + _lowest(_source_soles[leg], leg))
	ground = minf(clear[0], clear[1]) if is_nan(at_ground) else at_ground
	for b in mapped:
		rotations[b] = _turns[b] * _rest[b]
	var thighs := _middle(_source)
	var lifted := ground + (thighs.dot(_up) - ground) * ratio
	places[0] = basis.level(thighs) + lifted * _up - rotations[0] * _thighs
	_put()
	var goals := PackedVector3Array()
	var sunk := 0.0
	for leg in 2:
		var high := (clear[leg] - ground) * ratio
		goals.append(_goal(leg, ground + high))
		sunk = maxf(sunk, _lacks(leg, goals[leg], high))
	for b in mapped:
		places[b] -= sunk * _up
	for leg in 2:
		_bend(leg, _raised(leg, goals[leg]))
	_put()
	_relate()


func _find_rest(floor_height: float) -> void:
	var rig := map.rig
	var joints := WayfarerCharacterJoints.new(map, basis)
	var at_rest: Dictionary[int, Quaternion] = {}
	for b in mapped:
		at_rest[b] = joints.turn * rig.rotations[map.node(b)]
		_above[b] = -1
		for node in rig.ancestors(map.node(b)):
			var bone: Variant = map.bones.find_key(node)
			if bone != null:
				_above[b] = WayfarerBones.NAMES.find(bone)
				break
	var place := joints.places
	var correct := _corrections(place)
	for b in mapped:
		_rest[b] = correct[b] * at_rest[b]
		var a := _above[b]
		if a < 0:
			continue
		_offset[b] = at_rest[a].inverse() * (place[b] - place[a])
		_gap[b] = rig.rotations[map.node(a)].inverse() * rig.rotations[rig.parents[map.node(b)]]
	var parent := rig.parents[map.node(0)]
	if parent >= 0:
		_base_turn = rig.rotations[parent]
		_base_place = rig.places[parent]
		_base_scale = rig.scales[parent]
	_thighs = at_rest[0].inverse() * (_middle(place) - place[0])
	_find_legs(joints, correct, floor_height)


## Of the thigh joints: where the pelvis is. A rig's hips joint lies anywhere around it.
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
	joints: WayfarerCharacterJoints, correct: Dictionary[int, Quaternion], floor_height: float
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
		floor_height = joints.floor_height
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
		_soles.append(_sole(own, height))
		var beside: Vector3 = stand[ankle] + own - thighs - (source[toe] - source_thighs)
		_stance.append(beside.dot(basis.left) * basis.left)
	ratio = (legs / 2.0 + high) / source_thighs.dot(_up)


## Of a foot that stands: heel and ball from the ankle, tip of the toes from the ball.
func _sole(ball: Vector3, height: float) -> PackedVector3Array:
	var ahead := basis.level(ball)
	var down := -height * _up
	return PackedVector3Array([down - _HEEL * ahead, down + ahead, _TIP * ahead])


## Rotations and places of the agent's bones in the world.
func _find_agent(frame: WayfarerPose) -> void:
	_turns[0] = frame.turns[0].normalized()
	_source[0] = frame.hips
	for b in range(1, WayfarerBones.COUNT):
		var parent := WayfarerBones.PARENTS[b]
		_turns[b] = (_turns[parent] * frame.turns[b]).normalized()
		_source[b] = _source[parent] + _turns[parent] * _source_offset[b]


## Height of the lowest point of a foot over its ankle.
func _lowest(sole: PackedVector3Array, leg: int) -> float:
	var ankle := _turns[LEGS[leg][2]]
	var ball := (ankle * sole[1]).dot(_up)
	var tip := ball + (_turns[LEGS[leg][3]] * sole[2]).dot(_up)
	return minf((ankle * sole[0]).dot(_up), minf(ball, tip))


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
	var print_at := _source[ankle] + _turns[ankle] * _source_soles[leg][1]
	var beside := arc(basis.forward, ahead) * _stance[leg]
	var goal := basis.level(print_at + beside - _turns[ankle] * _soles[leg][1])
	return goal + (sole - _lowest(_soles[leg], leg)) * _up


## How far the hips must sink for a foot to reach its print; `high`: of the sole over the ground.
func _lacks(leg: int, goal: Vector3, high: float) -> float:
	var start := places[LEGS[leg][0]]
	var knee := places[LEGS[leg][1]]
	var most := _REACH * (start.distance_to(knee) + knee.distance_to(places[LEGS[leg][2]]))
	var away := basis.level(goal - start).length()
	var lacking := (start - goal).dot(_up) - sqrt(maxf(0.0, most * most - away * away))
	var share := clampf((_LEAVES - high / most) / (_LEAVES - _STANDS), 0.0, 1.0)
	return minf(_SINKS * most, maxf(0.0, lacking) * share)


## The goal with the heel up so far that the leg reaches it: the foot turns about its ball, as far
## as the ball bears it.
func _raised(leg: int, goal: Vector3) -> Vector3:
	var ankle: int = LEGS[leg][2]
	var start := places[LEGS[leg][0]]
	var knee := places[LEGS[leg][1]]
	var most := _REACH * (start.distance_to(knee) + knee.distance_to(places[ankle]))
	var heel := _turns[ankle] * _soles[leg][0]
	var ball := _turns[ankle] * _soles[leg][1]
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
	var bears := clampf(1.0 - (ball - heel).dot(_up) / (_STANDS * most), 0.0, 1.0)
	var half := bears * clampf(lacking, 0.0, _TIPTOE) / 2.0
	var about := sin(half) * axis
	var turn := Quaternion(about.x, about.y, about.z, cos(half))
	rotations[ankle] = turn * rotations[ankle]
	return goal + ball - turn * ball


## Turn thigh and shin so that the ankle is at the goal, or as near as the leg reaches.
func _bend(leg: int, goal: Vector3) -> void:
	var hip: int = LEGS[leg][0]
	var knee: int = LEGS[leg][1]
	var ankle: int = LEGS[leg][2]
	var start := places[hip]
	var bend := places[knee] - start
	var shank := places[ankle] - places[knee]
	var thigh := bend.length()
	var shin := shank.length()
	goal = _within(start, goal, _REACH * (thigh + shin), 1.001 * absf(thigh - shin))
	var far := start.distance_to(goal)
	var along := (goal - start) / far
	var side := bend - bend.dot(along) * along
	var front := _turns[hip] * basis.forward
	front -= front.dot(along) * along
	side += maxf(0.0, _BEND * thigh - side.length()) / maxf(front.length(), 1e-6) * front
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


## Rotations relative to the nodes' parents.
func _relate() -> void:
	local[0] = _base_turn.inverse() * rotations[0]
	for b in mapped:
		if b > 0:
			local[b] = (rotations[_above[b]] * _gap[b]).inverse() * rotations[b]
	hips = (_base_turn.inverse() * (places[0] - _base_place)) / _base_scale


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
