extends SceneTree
## The nodes against a live server: one agent walks to a goal on characters of several kinds,
## through a lost connection, and their bones are read back; then the demo's crowd walks about.
##   godot --headless --path clients/godot -s tests/live.gd -- tests/golden http://localhost:8080

const Checks := preload("res://tests/checks.gd")
const KINDS: Array[String] = ["mixamo", "a_pose", "centimetres", "z_up", "missing_chest"]
const PATIENCE := 60.0  # seconds


## A character of a golden case, as nodes of the engine.
class Walker:
	var kind: String
	var character := Node3D.new()
	var skeleton := Skeleton3D.new()
	var modifier: WayfarerCharacter
	var hips: int
	var ankles: Array[int] = []
	var places: Dictionary[int, Vector3] = {}  # of these bones in the scene, with the modifier at work
	var most := 0.0  # height of a standing foot's ankle

	func _init(found: Dictionary, parent: Node) -> void:
		kind = found.name
		var armature := Node3D.new()
		armature.transform = _transform(found.nodes[0])
		for node: Dictionary in found.nodes.slice(1):
			var bone := skeleton.add_bone(_name(node.name))
			skeleton.set_bone_parent(bone, int(node.parent) - 1)
			skeleton.set_bone_rest(bone, _transform(node))
		skeleton.reset_bone_poses()
		parent.add_child(character)
		character.add_child(armature)
		armature.add_child(skeleton)
		modifier = WayfarerCharacter.attach(character)
		hips = skeleton.find_bone(_name(found.map.pelvis))
		for ankle: String in [found.map.left_ankle, found.map.right_ankle]:
			ankles.append(skeleton.find_bone(_name(ankle)))
		modifier.modification_processed.connect(_look)

	func _look() -> void:
		for bone: int in [hips, ankles[0], ankles[1]]:
			places[bone] = skeleton.global_transform * skeleton.get_bone_global_pose(bone).origin
		if modifier.retarget == null:
			return
		for leg in 2:
			if modifier.played.track.contacts & (1 << leg):
				most = maxf(most, places[ankles[leg]].y - 2.0)

	func check(goal: Vector3, to: Checks) -> void:
		var off := places[hips] - goal
		var wanted := modifier.retarget.ratio * modifier.played.pose.hips.y
		to.holds(Vector2(off.x, off.z).length() < 0.5, "%s: hips %s from the goal" % [kind, off])
		# the ratio is that of the thigh joints, and hips sink a little for short legs
		to.holds(absf(off.y / wanted - 1.0) < 0.04, "%s: hips %f m high" % [kind, off.y])
		for ankle in ankles:
			var high := places[ankle].y - goal.y
			to.holds(high > 0.03 and high < 0.2, "%s: ankle %f m high" % [kind, high])
		to.holds(most > 0.03 and most < 0.3, "%s: a standing ankle %f m high" % [kind, most])
		var beside := character.global_position - places[hips]
		to.holds(Vector2(beside.x, beside.z).length() < 0.15, "%s: its node is %s off" % [kind, beside])
		to.holds(absf(character.global_position.y - goal.y) < 0.02, kind + ": on the ground")
		print("%s: walked to %.2f, %.2f" % [kind, places[hips].x, places[hips].z])

	## As the engine's importers do: its bones may have no colons.
	static func _name(of: String) -> String:
		return of.replace(":", "_")

	static func _transform(node: Dictionary) -> Transform3D:
		var turn := Basis(Checks.turn(node.rotation).normalized())
		return Transform3D(turn.scaled_local(Checks.place(node.scale)), Checks.place(node.position))


var _check: Checks


func _initialize() -> void:
	var arguments := OS.get_cmdline_user_args()
	_check = Checks.new(arguments[0])
	await process_frame
	await _walk(arguments[1])
	await _crowd(arguments[1])
	for failure in _check.failures:
		print("FAILED ", failure)
	quit(1 if _check.failures else 0)


func _walk(server: String) -> void:
	_check.begin("live")
	var session := WayfarerSession.new()
	session.server = server
	session.transform = Transform3D(Basis(Vector3.UP, PI / 2), Vector3(10, 2, -5))  # turned, elsewhere
	root.add_child(session)
	var goal := Node3D.new()
	goal.position = Vector3(12.5, 2, -2)
	root.add_child(goal)
	var cases: Array = _check.document("retarget.json").cases
	var walkers: Array[Walker] = []
	for kind in KINDS:
		var found: Array = cases.filter(func(c: Dictionary) -> bool: return c.name == kind)
		var walker := Walker.new(found[0], root)
		walker.character.transform = Transform3D(Basis(Vector3.UP, 0.5), Vector3(11, 2, -4))
		walker.modifier.active = walkers.is_empty()
		walkers.append(walker)
	var first := walkers[0].modifier
	first.target = goal
	if not await _until(func() -> bool: return first.id != "", "no agent"):
		return
	for walker in walkers.slice(1):
		walker.modifier.agent_id = first.id
		walker.modifier.active = true
	var arrived := [INF]
	session.happened.connect(
		func(told: WayfarerStreamDecoder.MotionEvent) -> void:
			if told.kind == "path_done":
				arrived[0] = told.at
	)
	var resumed: Array[bool] = []
	session.player.header_received.connect(
		func(header: WayfarerStreamDecoder.Header, _again: bool) -> void:
			resumed.append(header.resumed)
	)
	await create_timer(1.0).timeout
	session.stream.reconnect("the test has cut it", WayfarerSession.seconds())
	var there := func() -> bool:
		return session.player.moment > arrived[0] + 0.5 and first.played.track.contacts == 3
	if await _until(there, "it has not arrived"):
		for walker in walkers:
			walker.check(goal.position, _check)
	_check.holds(true in resumed, "the stream was resumed")
	_check.equal(session.player.stats.gaps, 0, "gaps")
	print("underruns %d" % session.player.underruns())
	for walker in walkers:
		walker.character.free()
	session.free()


func _crowd(server: String) -> void:
	_check.begin("crowd")
	var crowd: Node3D = load("res://demo/crowd.tscn").instantiate()
	crowd.people = 5
	crowd.radius = 4.0
	crowd.get_node("WayfarerSession").server = server
	root.add_child(crowd)
	var all_there := func() -> bool:
		return crowd.figures.all(func(w: WayfarerCharacter) -> bool: return w.retarget != null)
	await _until(all_there, "the crowd has not come")
	var before: Array = crowd.figures.map(
		func(w: WayfarerCharacter) -> Vector3: return w.character.position
	)
	var walking := func() -> bool:
		var moved := 0
		for k in before.size():
			moved += 1 if crowd.figures[k].character.position.distance_to(before[k]) > 0.5 else 0
		return moved >= 3
	if await _until(walking, "the crowd stands"):
		print("crowd: 5 people walk about")
	crowd.free()


func _until(done: Callable, failure: String) -> bool:
	var end := WayfarerSession.seconds() + PATIENCE
	while not done.call():
		if WayfarerSession.seconds() > end:
			_check.holds(false, failure)
			return false
		await process_frame
	return true
