extends RefCounted
## Bones of characters and poses on them: the traces that every client follows, and more.

const Checks := preload("res://tests/checks.gd")


func test_cases(check: Checks) -> void:
	var document := check.document("retarget.json")
	for wanted: Dictionary in document.cases:
		var basis := WayfarerBasis.new(wanted.basis)
		var map := _map(wanted)
		check.equal(map.error, "", wanted.name)
		check.equal(map.found_by, wanted.found_by, wanted.name)
		for bone: String in wanted.map:
			check.equal(map.table().get(bone), wanted.map[bone], "%s: %s" % [wanted.name, bone])
		check.equal(map.bones.size(), wanted.map.size(), wanted.name)
		var walk: Dictionary = document.walk[wanted.basis]
		var retarget := _retarget(map, walk, basis, _soles(wanted, map, basis))
		check.equal(retarget.loose.size(), wanted.poses[0].moved.size(), wanted.name)
		check.near(retarget.ratio, wanted.ratio, 1e-5, "%s: ratio" % wanted.name)
		var unit := 100.0 if wanted.basis.begins_with("unreal") else 1.0
		for k: int in walk.hips.size():
			retarget.pose(_frame(walk, k))
			for b in retarget.mapped:
				var bone := WayfarerBones.NAMES[b]
				var what := "%s: %s of frame %d" % [wanted.name, bone, k]
				var pose: Dictionary = wanted.poses[k]
				check.near_place(retarget.places[b], pose.places[bone], 1e-4 * unit, what)
				check.near_turn(retarget.rotations[b], pose.rotations[bone], 1e-4, what)
				if pose.moved.has(bone):
					var within := 1e-4 * (100.0 if wanted.name == "centimetres" else unit)
					check.near_place(retarget.moved[b], pose.moved[bone], within, what)


func test_what_cannot_walk_on_two_legs_is_refused(check: Checks) -> void:
	for refused: Dictionary in check.document("retarget.json").refused:
		var error := WayfarerBoneMap.of(Checks.rig(refused.nodes)).error
		check.holds(refused.says in error, "%s: %s" % [refused.name, error])


func test_local_rotations_give_the_same_places_through_the_nodes(check: Checks) -> void:
	var document := check.document("retarget.json")
	for wanted: Dictionary in document.cases:
		var unit := 100.0 if wanted.basis.begins_with("unreal") else 1.0
		var walk: Dictionary = document.walk[wanted.basis]
		var retarget := _retarget(_map(wanted), walk, WayfarerBasis.new(wanted.basis))
		for k: int in walk.hips.size():
			retarget.pose(_frame(walk, k))
			var posed: Array = wanted.nodes.duplicate(true)
			for b in retarget.mapped:
				var q := retarget.local[b]
				posed[retarget.map.node(b)].rotation = [q.x, q.y, q.z, q.w]
			for b in retarget.loose:
				var place := retarget.moved[b]
				posed[retarget.map.node(b)].position = [place.x, place.y, place.z]
			var rig := Checks.rig(posed)
			for b in retarget.mapped:
				var off := rig.places[retarget.map.node(b)].distance_to(retarget.places[b])
				check.holds(off < 1e-4 * unit, "%s: %s: %f" % [wanted.name, b, off])


func test_foreign_rigs(check: Checks) -> void:
	var rigs: Dictionary = check.document("foreign_rigs.json").rigs
	for name: String in rigs:
		var rig := WayfarerRig.new()
		rig.add("Armature", -1, Vector3.ZERO, Quaternion(Vector3.RIGHT, -PI / 2))
		for bone: Array in rigs[name]:
			var above := Vector3.ZERO
			if bone[1] >= 0:
				above = Checks.place(rigs[name][int(bone[1])][2])
			rig.add(bone[0], int(bone[1]) + 1, Checks.place(bone[2]) - above)
		var map := WayfarerBoneMap.of(rig)
		check.equal([map.found_by, map.missing()], ["names", []], name)


func test_feet_stand_at_a_height_that_is_given(check: Checks) -> void:
	var document := check.document("retarget.json")
	var walk: Dictionary = document.walk.gltf
	var retarget := _retarget(_map(document.cases[0]), walk, WayfarerBasis.new())
	var frame := _frame(walk, 0)
	retarget.pose(frame, 0.0)
	var low := retarget.places.duplicate()
	frame.hips.y += 3.0
	retarget.pose(frame, 3.0)
	for b in retarget.mapped:
		var moved := retarget.places[b] - low[b]
		check.holds(moved.distance_to(Vector3(0, 3, 0)) < 1e-5, WayfarerBones.NAMES[b])


func test_a_map_can_be_shown_and_corrected(check: Checks) -> void:
	var map := _map(check.document("retarget.json").cases[0])
	check.equal([map.table().left_knee, map.missing()], ["left_knee", []])
	var other := map.corrected({"spine2": "", "neck": "head", "head": ""})
	check.equal(
		[other.error, other.missing(), other.found_by, other.table().neck],
		["", ["spine2", "head"], "user", "head"]
	)
	var refused := {
		'no node "nose"': {"head": "nose"},
		'"tail" is no bone': {"tail": "head"},
		"no node was found for left_knee, neither": {"left_knee": ""},
		'left_knee: "head" is head, too': {"left_knee": "head"},
		'left_knee: "head" hangs from neck': {"left_knee": "head", "head": ""},
	}
	for said: String in refused:
		var error := map.corrected(refused[said]).error
		check.holds(said in error, "%s: %s" % [said, error])


func test_a_map_that_failed_is_completed_by_corrections(check: Checks) -> void:
	var named: WayfarerRig = _map(check.document("retarget.json").cases[0]).rig
	var rig := WayfarerRig.new()
	for k in named.names.size():  # nor by shape
		rig.add(named.names[k].replace("left_knee", "x"), named.parents[k])
	var failed := WayfarerBoneMap.of(rig)
	check.holds("no node was found for left_knee, neither" in failed.error, failed.error)
	var found := failed.corrected({"left_knee": "x"})
	check.equal([found.error, found.missing(), found.found_by], ["", [], "user"])


func test_what_is_no_humanoid_is_refused_in_words(check: Checks) -> void:
	var rig := WayfarerRig.new()
	rig.add("table", -1)
	rig.add("leg1", 0, Vector3(0, -1, 0))
	rig.add("leg2", 0, Vector3(1, -1, 0))
	var said := "no node was found for pelvis, left_hip"
	check.holds(said in WayfarerBoneMap.of(rig).error, "table")
	check.holds(said in WayfarerBoneMap.of(WayfarerRig.new()).error, "nothing")
	rig.add("a", 7)
	check.equal(rig.error, "node 3 (a): its parent must stand before it")


func test_joints_for_a_body_that_fits(check: Checks) -> void:
	var cases: Array = check.document("retarget.json").cases
	var basis := WayfarerBasis.new()
	var upright := WayfarerCharacterJoints.new(_map(cases[0]), basis)
	check.equal([upright.places.size(), upright.floor_height], [22, 0.0])
	for wanted: Dictionary in cases.filter(func(c: Dictionary) -> bool: return c.name == "z_up"):
		var joints := WayfarerCharacterJoints.new(_map(wanted), basis)
		check.near(joints.places[0].y, upright.places[0].y, 1e-3, "z_up: height of the hips")


static func _map(wanted: Dictionary) -> WayfarerBoneMap:
	var humanoid: Dictionary = wanted.humanoid if wanted.humanoid != null else {}
	return WayfarerBoneMap.of(Checks.rig(wanted.nodes), humanoid, WayfarerBasis.new(wanted.basis))


## The soles of a case's shoes, or null.
static func _soles(
	wanted: Dictionary, map: WayfarerBoneMap, basis: WayfarerBasis
) -> WayfarerSoles:
	if wanted.mesh == null:
		return null
	var places := PackedVector3Array()
	for place: Array in wanted.mesh.places:
		places.append(Checks.place(place))
	var soles := WayfarerSoles.measure(map, places, PackedInt32Array(wanted.mesh.nodes), basis)
	return soles


static func _retarget(
	map: WayfarerBoneMap, walk: Dictionary, basis: WayfarerBasis, soles: WayfarerSoles = null
) -> WayfarerRetarget:
	var offsets := PackedFloat64Array()
	for offset: Array in walk.rest_offsets:
		offsets.append_array(PackedFloat64Array(offset))
	return WayfarerRetarget.new(map, offsets, basis, NAN, soles)


static func _frame(walk: Dictionary, k: int) -> WayfarerPose:
	var frame := WayfarerPose.new(WayfarerBones.COUNT)
	frame.hips = Checks.place(walk.hips[k])
	for b in WayfarerBones.COUNT:
		frame.turns[b] = Checks.turn(walk.rotations[k][b])
	return frame
