extends RefCounted
## Vectors and traces that every client follows: tests/golden/README.md.

const Checks := preload("res://tests/checks.gd")
const ENCODINGS := {"f32_le": 1, "smallest_three": 3}


func test_vectors(check: Checks) -> void:
	var document := check.document("vectors.json")
	for vector: Dictionary in document.vectors:
		var encoding: int = ENCODINGS[vector.encoding]
		var bones: int = vector.bones.size()
		var bytes := FileAccess.get_file_as_bytes(check.golden.path_join(vector.poses))
		check.equal(WayfarerPoses.frame_bytes(encoding, bones), int(vector.frame_bytes), vector.name)
		check.equal(bytes.size(), int(vector.frame_bytes) * vector.frames.size(), vector.name)
		var wanted: Dictionary = document.bases[vector.basis]
		var tolerance := deg_to_rad(document.tolerance_deg[vector.encoding]) + 1e-7
		var found := WayfarerPoses.unpack(bytes, 0, vector.frames.size(), encoding, bones)
		for k: int in vector.frames.size():
			var number := int(vector.frames[k])
			check.equal(found[k].hips, Checks.place(wanted.translation[number]), vector.name)
			var turns: Array = wanted.rotations[number]
			for b in bones:
				var bone := int(vector.bones[b])
				var exact := Checks.turn(turns[bone]) if bone < turns.size() else Quaternion.IDENTITY
				var off := minf(_gap(found[k].turns[b], exact), _gap(found[k].turns[b], -exact))
				check.holds(off <= tolerance, "%s, bone %d: %f" % [vector.name, bone, off])
	check.equal(WayfarerPoses.frame_bytes(9, 22), 0, "an encoding of a later server")


func test_clock(check: Checks) -> void:
	var kinds: Dictionary = check.document("playout.json").clock
	for kind: String in kinds:
		var clock := WayfarerPlayoutClock.new()
		for told: Array in kinds[kind]:
			var now: float = told[1]
			if told[0] == "message":
				clock.observe(now, told[2])
			elif told[0] == "chunk":
				clock.observe_chunk(now, told[2])
			elif told[0] == "resumed":
				clock.resumed(told[2])
			else:
				check.near(clock.advance(now), told[2], 1e-6, "%s: moment at %s" % [kind, now])
				check.near(clock.delay(now), told[3], 1e-6, "%s: delay at %s" % [kind, now])


func test_track(check: Checks) -> void:
	var kinds: Dictionary = check.document("playout.json").track
	for kind: String in kinds:
		var track := WayfarerPoseTrack.new(2)
		var found := WayfarerPose.new(2)
		for told: Array in kinds[kind]:
			var at := "%s at %s" % [kind, told[1]]
			if told[0] == "push":
				var poses: Array[WayfarerPose] = []
				poses.assign(told[3].map(Checks.pose))
				track.push(told[1], told[2], poses, PackedByteArray(told[4]))
				continue
			check.equal(track.sample(told[1], found), told[2] != null, at)
			if told[2] == null:
				continue
			check.near_place(found.hips, told[2], 1e-5, at)
			for k in 2:
				check.near_turn(found.turns[k], told[2].slice(3 + 4 * k, 7 + 4 * k), 1e-5, at)
			check.equal(track.contacts, int(told[3]), at)
			check.near(track.buffered(told[1]), told[4], 1e-6, at)
			check.equal(track.underruns, int(told[5]), at)


func test_root(check: Checks) -> void:
	var root := WayfarerSmoothRoot.new(WayfarerBasis.new("gltf"))
	for told: Array in check.document("playout.json").root:
		root.update(told[0], Checks.place(told[1]), Checks.turn(told[2]), told[3])
		check.near_place(root.point, told[4], 1e-5, "point at %s" % told[0])
		check.near(root.heading, told[5], 1e-5, "heading at %s" % told[0])


func test_a_background_program_keeps_a_bounded_number_of_frames(check: Checks) -> void:
	var track := WayfarerPoseTrack.new(1)
	for k in 1000:
		var poses: Array[WayfarerPose] = []
		for frame in 8:
			poses.append(WayfarerPose.new(1))
		track.push(0.2 * k, 40.0, poses, PackedByteArray([0, 0, 0, 0, 0, 0, 0, 0]))
	check.equal(track.length(), 400)
	check.near(track.buffered(0.0), 199.8 + 7.0 / 40.0, 1e-9, "the newest are kept")


func test_heading(check: Checks) -> void:
	for name in WayfarerBasis.NAMES:
		var basis := WayfarerBasis.new(name)
		for angle: float in [0.0, 1.0, -2.0, 3.0]:
			check.near(basis.heading_of(Quaternion(basis.up, angle)), angle, 1e-6, name)


## Angle between two rotations of the same sign, radians: exact for small ones, too.
static func _gap(a: Quaternion, b: Quaternion) -> float:
	return 4.0 * asin(minf(1.0, (a - b).length() / 2.0))
