class_name WayfarerBoneMap
extends RefCounted
## Maps nodes of a rig to bones: by VRM's table, otherwise by names, otherwise by shape.
## clients/README.md, "Bones of a character". It can be shown and corrected.

const SIDES: Array[String] = ["left", "right"]
const REQUIRED: Array[String] = [
	"pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle"
]
const _TRUNK: Array[String] = ["pelvis", "spine1", "spine2", "spine3", "neck", "head"]
## Bones that may hang from any bone of the trunk; they move with that bone.
const _BRANCHING: Array[String] = ["hip", "collar", "shoulder"]
const _UNEVEN := 1.01  # greatest ratio between the scales of a node's axes
const _BACKWARD := 0.2  # cosine of the angle up to which toes may point backwards
## Greatest height of an ankle over its leg's lowest node, as a share of the thigh's height.
const _HEELS := 0.3
const _HIND_LEGS := (
	"legs as animals' hind legs, whose heels are off the ground, are not found by their shape. "
	+ "Say which bones these are, by a correction"
)

## Why this rig is no humanoid; "": it is one.
var error := ""
var rig: WayfarerRig
var bones: Dictionary[String, int] = {}
## "vrm" (a table of the file), "names", "shape" or "user".
var found_by := ""


## The map of a rig. `humanoid`: VRM's names → nodes, or {}. `basis`: gives the up of the rig's
## space. If too little is found, `error` says so; `corrected` may still complete the map.
static func of(
	of_rig: WayfarerRig, humanoid: Dictionary = {}, basis: WayfarerBasis = WayfarerBasis.new()
) -> WayfarerBoneMap:
	var by := "vrm"
	var found := _by_vrm(humanoid)
	if humanoid.is_empty():
		by = "names"
		found = WayfarerBonesByName.new(of_rig).find()
		if not found.has_all(REQUIRED):
			var shaped := WayfarerBonesByShape.new(of_rig, basis).find()
			if shaped.has_all(REQUIRED):
				by = "shape"
				found = shaped
	var map := from_bones(of_rig, _kept(of_rig, found), by)
	if map.error == "":
		map.error = map._check_biped(basis)
	return map


## A map of your own: bone → node.
static func from_bones(
	of_rig: WayfarerRig, table: Dictionary[String, int], by: String = "user"
) -> WayfarerBoneMap:
	var map := WayfarerBoneMap.new()
	map.rig = of_rig
	map.found_by = by
	map.error = map._take(table)
	return map


## The map with other nodes for some bones (by node name), or without them ("").
func corrected(changes: Dictionary) -> WayfarerBoneMap:
	var changed := bones.duplicate()
	for bone: String in changes:
		changed.erase(bone)
		var name: String = changes[bone]
		if name == "":
			continue
		changed[bone] = rig.names.find(name)
		if changed[bone] < 0:
			var refused := WayfarerBoneMap.new()
			refused.rig = rig
			refused.error = '%s: the rig has no node "%s"' % [bone, name]
			return refused
	return from_bones(rig, changed)


## Bones that the rig lacks; their children take over their rotations.
func missing() -> Array[String]:
	return WayfarerBones.NAMES.filter(func(bone: String) -> bool: return not bones.has(bone))


## Canonical name → name of the node: to show it, or keep it.
func table() -> Dictionary[String, String]:
	var found: Dictionary[String, String] = {}
	for bone in bones:
		found[bone] = rig.names[bones[bone]]
	return found


## Node of a bone's number, or -1.
func node(bone: int) -> int:
	return bones.get(WayfarerBones.NAMES[bone], -1)


## Keep the bones in canonical order; returns what is wrong with them, or "".
func _take(table_of: Dictionary[String, int]) -> String:
	for bone in table_of:
		if not bone in WayfarerBones.NAMES:
			return '"%s" is no bone; bones are %s' % [bone, ", ".join(WayfarerBones.NAMES)]
	for bone in WayfarerBones.NAMES:
		if table_of.has(bone):
			bones[bone] = table_of[bone]
	var lacking := REQUIRED.filter(func(bone: String) -> bool: return not bones.has(bone))
	if not lacking.is_empty():
		return _unknown(lacking)
	var line: Dictionary[int, bool] = {}
	for bone in bones:
		for k in rig.ancestors(bones[bone]):
			line[k] = true
		var other := _misplaced(rig, bones, bone)
		if other != "":
			var is_twin := bones[other] == bones[bone]
			var said := "is %s, too" % other if is_twin else "hangs from %s" % other
			return '%s: "%s" %s' % [bone, rig.names[bones[bone]], said]
	for k in line:
		var scale := rig.own_scales[k]
		var most := scale[scale.max_axis_index()]
		if most > 0.0 and most <= _UNEVEN * scale[scale.min_axis_index()]:
			continue
		return (
			'"%s" is scaled by %s, %s, %s: bones below it would be sheared or mirrored as they turn. '
			% [rig.names[k], _short(scale.x), _short(scale.y), _short(scale.z)]
			+ "Apply its scale to the model, and export it again"
		)
	return ""


static func _short(value: float) -> String:
	return String.num(value, 5).trim_suffix(".0")


## The error for bones that were not found.
static func _unknown(lacking: Array) -> String:
	var known := PackedStringArray()
	for bone: String in lacking:
		var role := _role(bone)
		var row := "%s: %s" % [role, ", ".join(WayfarerBoneNames.ROLES[role])]
		if not row in known:
			known.append(row)
	return (
		"no node was found for %s, neither by names nor by shape: " % ", ".join(lacking)
		+ "say which they are, by a correction. "
		+ "Known names, with sides as in LeftFoot, foot_l, foot.L: %s" % "; ".join(known)
	)


static func _role(bone: String) -> String:
	return bone.trim_prefix("left_").trim_prefix("right_")


## The bones without optional ones whose place is impossible.
static func _kept(
	of_rig: WayfarerRig, found: Dictionary[String, int]
) -> Dictionary[String, int]:
	var kept := found.duplicate()
	for bone in WayfarerBones.NAMES:
		if kept.has(bone) and not bone in REQUIRED and _misplaced(of_rig, kept, bone) != "":
			kept.erase(bone)
	return kept


## The bone that this one wrongly hangs from or shares a node with; "": none.
static func _misplaced(
	of_rig: WayfarerRig, found: Dictionary[String, int], bone: String
) -> String:
	for other in WayfarerBones.NAMES:
		if other != bone and found.get(other, -1) == found[bone]:
			return other
	var above := ""
	for k in of_rig.ancestors(found[bone]):
		var name: Variant = found.find_key(k)
		if name != null:
			above = name
			break
	if above == "" or _leads_to(above, bone):
		return ""
	var branches := _role(bone) in _BRANCHING or bone in _TRUNK
	return "" if branches and above in _TRUNK and not _leads_to(bone, above) else above


## Whether a bone is above another on the way to the pelvis.
static func _leads_to(upper: String, bone: String) -> bool:
	var k := WayfarerBones.PARENTS[WayfarerBones.NAMES.find(bone)]
	while k >= 0:
		if WayfarerBones.NAMES[k] == upper:
			return true
		k = WayfarerBones.PARENTS[k]
	return false


## The error for animals, and for sides that contradict each other; "": none.
func _check_biped(basis: WayfarerBasis) -> String:
	var hips := PackedInt32Array([bones["left_hip"], bones["right_hip"]])
	var others := WayfarerBonesByShape.new(rig, basis).other_legs(bones["pelvis"], hips)
	if not others.is_empty():
		var legs := Array(hips + others).map(func(k: int) -> String: return '"%s"' % rig.names[k])
		return "it has four legs (%s): only what walks on two can be animated" % ", ".join(legs)
	var against := WayfarerBonesByName.contradicted(self)
	if against != "":
		return (
			'"%s" is on the other side than its name tells, by where the feet point: %s'
			% [against, _HIND_LEGS]
		)
	var up := Vector3.ZERO
	var toes := Vector3.ZERO
	for side in SIDES:
		var ankle := rig.places[bones[side + "_ankle"]]
		up += rig.places[bones[side + "_hip"]] - ankle
		if bones.has(side + "_foot"):
			toes += rig.places[bones[side + "_foot"]] - ankle
	for side in SIDES:
		var ankle := bones[side + "_ankle"]
		var low := INF
		for k in rig.subtree(ankle):
			low = minf(low, rig.places[k].dot(up))
		var thigh := rig.places[bones[side + "_hip"]].dot(up)
		if rig.places[ankle].dot(up) - low > _HEELS * (thigh - low):
			return (
				'"%s" is high above the ground for an ankle: %s' % [rig.names[ankle], _HIND_LEGS]
			)
	var forward := basis.handed * (rig.places[hips[0]] - rig.places[hips[1]]).cross(up)
	if toes.dot(forward) < -_BACKWARD * toes.length() * forward.length():
		return (
			"its toes point backwards: left and right are exchanged, or these are no feet "
			+ '("%s" counts as left)' % rig.names[hips[0]]
		)
	return ""


static func _by_vrm(humanoid: Dictionary) -> Dictionary[String, int]:
	var found: Dictionary[String, int] = {}
	for bone: String in WayfarerBoneNames.VRM:
		if humanoid.has(WayfarerBoneNames.VRM[bone]):
			found[bone] = int(humanoid[WayfarerBoneNames.VRM[bone]])
	var chain := PackedInt32Array()
	for name in WayfarerBoneNames.VRM_SPINE:
		if humanoid.has(name):
			chain.append(int(humanoid[name]))
	spread_spine(chain, found)
	return found


## Nodes between pelvis and neck → spine bones: the last, from which arms hang, is spine3.
static func spread_spine(chain: PackedInt32Array, into: Dictionary[String, int]) -> void:
	var count := chain.size()
	if count == 1:
		into["spine3"] = chain[0]
	elif count == 2:
		into["spine1"] = chain[0]
		into["spine3"] = chain[1]
	elif count > 2:
		for k in 3:
			@warning_ignore("integer_division")
			into["spine%d" % (k + 1)] = chain[(k * (count - 1) + 1) / 2]
