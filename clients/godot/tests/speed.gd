extends SceneTree
## Prints milliseconds of an agent: to sample and to retarget (once per picture), to unpack a frame.
##   godot --headless --path clients/godot -s tests/speed.gd -- tests/golden

const Checks := preload("res://tests/checks.gd")
const FRAMES := 200
const ENCODINGS := {"f32_le": 1, "smallest_three": 3}


func _initialize() -> void:
	var check := Checks.new(OS.get_cmdline_user_args()[0])
	var document := check.document("retarget.json")
	var walk: Dictionary = document.walk.gltf
	var offsets := PackedFloat64Array()
	for offset: Array in walk.rest_offsets:
		offsets.append_array(PackedFloat64Array(offset))
	var map := WayfarerBoneMap.of(Checks.rig(document.cases[0].nodes))
	var retarget := WayfarerRetarget.new(map, offsets)
	var track := WayfarerPoseTrack.new(WayfarerBones.COUNT)
	var poses: Array[WayfarerPose] = []
	for k in 400:
		var pose := WayfarerPose.new(WayfarerBones.COUNT)
		pose.hips = Checks.place(walk.hips[k % 5])
		for b in WayfarerBones.COUNT:
			pose.turns[b] = Checks.turn(walk.rotations[k % 5][b])
		poses.append(pose)
	var feet := PackedByteArray()
	feet.resize(400)
	track.push(0.0, 40.0, poses, feet)
	var out := WayfarerPose.new(WayfarerBones.COUNT)
	var begun := Time.get_ticks_usec()
	for k in FRAMES:
		track.sample(k / 60.0, out)
	var sampled := Time.get_ticks_usec()
	for k in FRAMES:
		retarget.pose(out)
	var posed := Time.get_ticks_usec()
	print("sample %.3f ms" % ((sampled - begun) / 1000.0 / FRAMES))
	print("retarget %.3f ms" % ((posed - sampled) / 1000.0 / FRAMES))
	for name: String in ENCODINGS:
		var bytes := FileAccess.get_file_as_bytes(
			check.golden.path_join("poses/gltf-%s-body-40.bin" % name)
		)
		var encoding: int = ENCODINGS[name]
		var start := Time.get_ticks_usec()
		for k in FRAMES:
			WayfarerPoses.unpack(bytes, 0, 5, encoding, 22)
		print("%s %.3f ms a frame" % [name, (Time.get_ticks_usec() - start) / 5000.0 / FRAMES])
	quit()
