@icon("res://addons/wayfarer/icon.svg")
class_name WayfarerCharacter
extends SkeletonModifier3D
## Makes a character walk: put it below the character's Skeleton3D. Any humanoid will do; its rest
## pose may have any axes. It needs no animations.

const NUDGE := 0.25  # metres that the target moves before the agent is sent again
const PATIENCE := 0.5  # seconds between two commands that follow the target

## None: the session in the tree.
@export var session: WayfarerSession
## What moves along, without the sway of the hips: the character's uppermost node. None: the scene
## that the skeleton is instanced from, or its parent.
@export var character: Node3D
## Id of an existing agent. Empty: an agent is created here, and deleted at the end.
@export var agent_id := ""
## Make the agent with this character's proportions, so that its steps fit the character's legs.
@export var fit_body := true
## Where it walks to. Move the target, and it follows.
@export var target: Node3D
## Metres per second, 0.2 to 4.
@export_range(0.2, 4.0) var speed := 1.2
## Without a target: it walks about within this many metres of its first place. 0: it stands.
@export var wander_radius := 0.0
## Corrections of the found nodes: canonical bone → name of the skeleton's bone, or "".
@export var corrections: Dictionary[String, String] = {}

## The map of the skeleton's bones; null before it is ready.
var map: WayfarerBoneMap
## Id of its agent; "": there is none yet.
var id := ""
## Its agent, once it is shown; or null.
var played: WayfarerMotionPlayer.PlayedAgent
## The agent's pose on its bones; null before it is shown.
var retarget: WayfarerRetarget
## A point on the ground and a heading that do not sway.
var root: WayfarerSmoothRoot

var _bone_of: Dictionary[int, int] = {}  # node of the rig → bone of the skeleton
var _rest: Array[Transform3D] = []  # of each bone in the skeleton's space, in the skin's bind pose
var _soles: WayfarerSoles
var _size := Vector3.ONE
var _seen := ""  # the session that the rest belongs to
var _creating := false
var _sent_to := Vector3.INF
var _sent_at := -INF


## Make a loaded character walk by its skeleton. Null: it has none.
static func attach(to: Node3D) -> WayfarerCharacter:
	var found := to.find_children("*", "Skeleton3D", true, false)
	if found.is_empty():
		push_error("Wayfarer: %s has no Skeleton3D" % to.name)
		return null
	var modifier := WayfarerCharacter.new()
	modifier.character = to
	found[0].add_child(modifier)
	return modifier


func _ready() -> void:
	if Engine.is_editor_hint():
		return
	var skeleton := get_skeleton()
	if skeleton == null:
		push_error("Wayfarer: %s must be below a Skeleton3D" % name)
		active = false
		return
	if character == null:
		character = _uppermost(skeleton)
	_read_rig(skeleton)
	if map.error != "":
		push_error("Wayfarer: %s cannot walk: %s. Set corrections." % [character.name, map.error])
		active = false


func _exit_tree() -> void:
	var source := _source()
	if source != null and id != "" and agent_id == "" and _seen == source.id:
		source.api.delete_agent(id)


## Send it to a place of the scene; with a yaw (radians, about up) to face there.
func go_to(world: Vector3, yaw: float = NAN) -> WayfarerApi.Reply:
	var how := {"speed": speed}
	if not is_nan(yaw):
		how.heading = wrapf(yaw - _source().global_rotation.y, -PI, PI)
	var goals := [WayfarerApi.goal(_source().place_of(world), how)]
	return _told(await _source().api.set_path(id, goals))


## Make it wander within some metres of a place of the scene.
func wander(world: Vector3, radius: float) -> WayfarerApi.Reply:
	var centre := _source().place_of(world)
	return _told(await _source().api.wander(id, centre, radius, {"speed": speed}))


## Stop it.
func stop() -> WayfarerApi.Reply:
	return _told(await _source().api.clear_goal(id))


func _process_modification() -> void:
	var source := _source()
	if map == null or map.error != "" or source == null or Engine.is_editor_hint():
		return
	if _seen != source.id:
		_forget(source.id)
	if _seen == "":
		return
	if played != null and played.hidden:
		played = null  # it has left the last ring; another comes when it is back
	if id == "":
		_find_id(source)
	elif played == null:
		_find_agent(source)
	if id != "" and target != null:
		_follow_target()
	if played != null and played.shown:
		_pose(source)


func _source() -> WayfarerSession:
	return session if session != null else WayfarerSession.current


## Begin again after the session has changed or gone.
func _forget(next: String) -> void:
	_seen = next
	id = ""
	played = null
	_sent_at = -INF


func _find_id(source: WayfarerSession) -> void:
	if agent_id != "":
		id = agent_id
	elif not _creating:
		_create(source)


func _create(source: WayfarerSession) -> void:
	_creating = true
	var began := _seen
	var spec := {"name": String(character.name).left(64)}
	spec.position = WayfarerApi.place(source.place_of(character.global_position))
	spec.heading = character.global_rotation.y - source.global_rotation.y
	var failure := ""
	if fit_body:
		var joints := WayfarerCharacterJoints.new(map, WayfarerBasis.new(), _soles)
		var fit: WayfarerApi.Reply = await source.api.fit_body(joints)
		failure = fit.error
		if failure == "":
			spec.gender = fit.data.gender
			spec.betas = fit.data.betas
	if failure == "":
		var made: WayfarerApi.Reply = await source.api.create_agents(began, [spec])
		failure = made.error
		if failure == "" and began == _seen:
			id = made.data.agents[0].agent_id
	_creating = false
	if failure != "":
		push_error("Wayfarer: %s has no agent: %s" % [character.name, failure])
		active = false
	elif target == null and wander_radius > 0.0:
		wander(character.global_position, wander_radius)


func _find_agent(source: WayfarerSession) -> void:
	for found: WayfarerMotionPlayer.PlayedAgent in source.player.agents.values():
		if found.agent.id == id:
			played = found
			var offsets := found.agent.rest_offsets
			retarget = WayfarerRetarget.new(map, offsets, WayfarerBasis.new(), NAN, _soles)
			root = WayfarerSmoothRoot.new(WayfarerBasis.new())


func _follow_target() -> void:
	var now := WayfarerSession.seconds()
	var moved := target.global_position.distance_to(_sent_to) > NUDGE
	if moved and now - _sent_at > PATIENCE:
		_sent_to = target.global_position
		_sent_at = now
		go_to(_sent_to)


func _pose(source: WayfarerSession) -> void:
	var skeleton := get_skeleton()
	var space := source.global_transform
	retarget.pose(played.pose)
	root.update(source.player.moment, played.pose.hips, played.pose.turns[0], retarget.ground)
	var turn := Basis(Vector3.UP, root.heading).scaled_local(_size)
	character.global_transform = space * Transform3D(turn, root.point)
	for b in retarget.mapped:
		if b > 0:
			skeleton.set_bone_pose_rotation(_bone_of[map.node(b)], retarget.local[b])
	for b in retarget.loose:
		if retarget.hangs(b) >= 0:  # from another bone than it follows
			skeleton.set_bone_pose_position(_bone_of[map.node(b)], retarget.moved[b])
		else:
			_put(skeleton, _bone_of[map.node(b)], space * _world_of(b))


func _world_of(b: int) -> Transform3D:
	return Transform3D(Basis(retarget.rotations[b]), retarget.places[b])


## Place a bone that hangs from an unmoving node, by its place in the scene.
func _put(skeleton: Skeleton3D, bone: int, wanted: Transform3D) -> void:
	var above := skeleton.global_transform
	if skeleton.get_bone_parent(bone) >= 0:
		above *= skeleton.get_bone_global_pose(skeleton.get_bone_parent(bone))
	var turned := above.basis.get_rotation_quaternion().inverse()
	skeleton.set_bone_pose_rotation(bone, turned * wanted.basis.get_rotation_quaternion())
	skeleton.set_bone_pose_position(bone, above.affine_inverse() * wanted.origin)


## The skeleton at rest as the core's rig; the character itself is taken to stand at the origin.
func _read_rig(skeleton: Skeleton3D) -> void:
	_size = character.global_basis.get_scale()
	var rig := WayfarerRig.new()
	rig.add("character", -1, Vector3.ZERO, Quaternion.IDENTITY, _size)
	var between := character.global_transform.affine_inverse() * skeleton.global_transform
	_add(rig, "skeleton", 0, between)
	var meshes := skeleton.find_children("*", "MeshInstance3D", true, false)
	_find_rest(skeleton, meshes)
	for bone in skeleton.get_parentless_bones():
		_collect(rig, skeleton, bone, 1)
	map = WayfarerBoneMap.of(rig)
	if not corrections.is_empty():
		map = map.corrected(corrections)
	if map.error == "":
		_measure_soles(skeleton, meshes, Transform3D(Basis.from_scale(_size)) * between)


## Rest is the skin's bind pose if the skeleton's own rest is a frame of an animation.
func _find_rest(skeleton: Skeleton3D, meshes: Array[Node]) -> void:
	_rest.clear()
	for bone in skeleton.get_bone_count():
		_rest.append(skeleton.get_bone_global_rest(bone))
	for mesh: MeshInstance3D in meshes:
		if mesh.skin == null:
			continue
		var moves: Array[Transform3D] = []
		for k in mesh.skin.get_bind_count():
			var bone := _bind_bone(skeleton, mesh.skin, k)
			if bone >= 0:
				moves.append(skeleton.get_bone_global_rest(bone) * mesh.skin.get_bind_pose(k))
		var alike := func(move: Transform3D) -> bool: return _near(move, moves[0])
		if moves.is_empty() or moves.all(alike):
			continue
		for k in mesh.skin.get_bind_count():
			var bone := _bind_bone(skeleton, mesh.skin, k)
			if bone >= 0:
				_rest[bone] = mesh.skin.get_bind_pose(k).affine_inverse()


static func _near(a: Transform3D, b: Transform3D) -> bool:
	var off := a.origin.distance_to(b.origin)
	return off < 0.01 and a.basis.x.distance_to(b.basis.x) < 0.01 * b.basis.x.length() + 0.001


static func _bind_bone(skeleton: Skeleton3D, skin: Skin, bind: int) -> int:
	var name := skin.get_bind_name(bind)
	return skeleton.find_bone(name) if name != &"" else skin.get_bind_bone(bind)


## The vertices of its skins at rest, with the bone that moves each most.
func _measure_soles(skeleton: Skeleton3D, meshes: Array[Node], space: Transform3D) -> void:
	var places := PackedVector3Array()
	var nodes := PackedInt32Array()
	for mesh: MeshInstance3D in meshes:
		if mesh.skin == null or mesh.mesh == null:
			continue
		var moves: Array[Transform3D] = []
		var movers := PackedInt32Array()
		for k in mesh.skin.get_bind_count():
			var bone := _bind_bone(skeleton, mesh.skin, k)
			moves.append(Transform3D() if bone < 0 else _rest[bone] * mesh.skin.get_bind_pose(k))
			movers.append(-1 if bone < 0 else _bone_of.find_key(bone))
		for surface in mesh.mesh.get_surface_count():
			var arrays := mesh.mesh.surface_get_arrays(surface)
			if arrays[Mesh.ARRAY_BONES] == null or arrays[Mesh.ARRAY_WEIGHTS] == null:
				continue
			var vertices: PackedVector3Array = arrays[Mesh.ARRAY_VERTEX]
			var weights: PackedFloat32Array = arrays[Mesh.ARRAY_WEIGHTS]
			@warning_ignore("integer_division")
			var count := weights.size() / maxi(1, vertices.size())
			for v in vertices.size():
				var most := count * v
				for k in range(count * v, count * v + count):
					most = k if weights[k] > weights[most] else most
				var bind: int = arrays[Mesh.ARRAY_BONES][most]
				if movers[bind] >= 0:
					places.append(space * (moves[bind] * vertices[v]))
					nodes.append(movers[bind])
	_soles = WayfarerSoles.measure(map, places, nodes)


func _collect(rig: WayfarerRig, skeleton: Skeleton3D, bone: int, parent: int) -> void:
	var above := skeleton.get_bone_parent(bone)
	var rest := _rest[bone] if above < 0 else _rest[above].affine_inverse() * _rest[bone]
	if not rest.is_equal_approx(skeleton.get_bone_rest(bone)):
		skeleton.set_bone_rest(bone, rest)
		skeleton.set_bone_pose(bone, rest)
	var node := _add(rig, skeleton.get_bone_name(bone), parent, rest)
	_bone_of[node] = bone
	for child in skeleton.get_bone_children(bone):
		_collect(rig, skeleton, child, node)


static func _add(rig: WayfarerRig, node: String, parent: int, at: Transform3D) -> int:
	var turn := at.basis.get_rotation_quaternion()
	return rig.add(node, parent, at.origin, turn, at.basis.get_scale())


static func _uppermost(skeleton: Skeleton3D) -> Node3D:
	var instanced := skeleton.owner as Node3D
	var whole := skeleton.get_tree().current_scene
	if instanced != null and instanced != whole and instanced.scene_file_path != "":
		return instanced
	return skeleton.get_parent_node_3d() if skeleton.get_parent_node_3d() != null else skeleton


func _told(reply: WayfarerApi.Reply) -> WayfarerApi.Reply:
	if reply.error != "":
		push_warning("Wayfarer: agent %s: %s" % [id, reply.error])
	return reply
