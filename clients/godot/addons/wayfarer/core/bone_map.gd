class_name WayfarerBoneMap
extends RefCounted
## Which node of a rig is which bone: by VRM's table, else by names, else by shape.
## clients/README.md, "Bones of a character". It can be shown and corrected.

const SIDES: Array[String] = ["left", "right"]
const REQUIRED: Array[String] = [
	"pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle"
]

## Why this rig is no humanoid; "": it is one.
var error := ""
var rig: WayfarerRig
var bones: Dictionary[String, int] = {}
## "vrm" (a table of the file), "names", "shape" or "user".
var found_by := ""


## The map of a rig. `humanoid`: VRM's names → nodes, or {}; `basis`: of its space, for its up.
## Where too little is found, `error` says so; `corrected` may still complete the map.
static func of(
	of_rig: WayfarerRig, humanoid: Dictionary = {}, basis: WayfarerBasis = WayfarerBasis.new()
) -> WayfarerBoneMap:
	if not humanoid.is_empty():
		return from_bones(of_rig, _by_vrm(humanoid), "vrm")
	var named := WayfarerBonesByName.new(of_rig).find()
	if named.has_all(REQUIRED):
		return from_bones(of_rig, named, "names")
	var shaped := WayfarerBonesByShape.new(of_rig, basis).find()
	if shaped.has_all(REQUIRED):
		return from_bones(of_rig, shaped, "shape")
	return from_bones(of_rig, named, "names")


## A map of your own: bone → node.
static func from_bones(
	of_rig: WayfarerRig, table: Dictionary[String, int], by: String = "user"
) -> WayfarerBoneMap:
	var map := WayfarerBoneMap.new()
	map.rig = of_rig
	map.found_by = by
	map.error = map._take(table)
	return map


## With other nodes for some bones (by node name), or without them ("").
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


## Bones that the rig lacks; their turns go on into their children.
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


## Keep the bones in canonical order; what is wrong with them, or "".
func _take(table_of: Dictionary[String, int]) -> String:
	for bone in table_of:
		if not bone in WayfarerBones.NAMES:
			return '"%s" is no bone; bones are %s' % [bone, ", ".join(WayfarerBones.NAMES)]
	for bone in WayfarerBones.NAMES:
		if table_of.has(bone):
			bones[bone] = table_of[bone]
	var lacking := REQUIRED.filter(func(bone: String) -> bool: return not bones.has(bone))
	if not lacking.is_empty():
		return (
			"neither names nor shape of this rig tell its %s: say which nodes these are, by a correction"
			% ", ".join(lacking)
		)
	for side in SIDES:
		for pair: Array in [
			[side + "_hip", "pelvis"], [side + "_knee", side + "_hip"],
			[side + "_ankle", side + "_knee"],
		]:
			if not bones[pair[1]] in rig.ancestors(bones[pair[0]]):
				var below := rig.names[bones[pair[0]]]
				return '%s: "%s" does not hang from the %s' % [pair[0], below, pair[1]]
	var bone_of: Dictionary[int, String] = {}
	for bone in bones:
		bone_of[bones[bone]] = bone
	for bone in bones:
		var above := ""
		for k in rig.ancestors(bones[bone]):
			if bone_of.has(k):
				above = bone_of[k]
				break
		var order := WayfarerBones.NAMES
		if (above == "") != (bone == "pelvis") or order.find(above) > order.find(bone):
			var name := rig.names[bones[bone]]
			return '%s: "%s" hangs from %s' % [bone, name, "no bone" if above == "" else above]
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
