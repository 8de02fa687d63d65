class_name WayfarerBonesByName
extends RefCounted
## Bones of a rig by the words of its nodes' names: clients/README.md, "Bones of a character".

const _BREAKS := (
	"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])"
)
# role, and the role of the bone that it hangs from
const _LIMBS: Array[Array] = [
	["hip", ""], ["knee", "hip"], ["ankle", "knee"], ["foot", "ankle"], ["shoulder", ""],
	["elbow", "shoulder"], ["wrist", "elbow"], ["collar", ""],
]

var _rig: WayfarerRig
var _side: Array[String] = []  # of each node: "left", "right", ""
var _rest: Array[String] = []  # of each node: the other words of its name; "": it is no bone
var _above: Array[PackedInt32Array] = []
var _bones: Dictionary[String, int] = {}
var _taken: Dictionary[int, bool] = {}


func _init(rig: WayfarerRig) -> void:
	_rig = rig
	var breaks := RegEx.create_from_string(_BREAKS)
	var others := RegEx.create_from_string("[^A-Za-z]+")
	for k in rig.names.size():
		_split(others.sub(breaks.sub(_last(rig.names[k]), " ", true), " ", true))
		_above.append(rig.ancestors(k))


func find() -> Dictionary[String, int]:
	for which in WayfarerBoneMap.SIDES:
		for limb in _LIMBS:
			var inside: int = _bones.get(which + "_" + limb[1], -1)
			_take(which + "_" + limb[0], limb[0], which, inside)
	_take("pelvis", "pelvis", "", -1)
	if _bones.has("left_hip") and _bones.has("right_hip"):
		var shared := _shared(_bones["left_hip"], _bones["right_hip"])
		if not shared.is_empty() and not _bones.get("pelvis", -1) in shared:
			_bones["pelvis"] = shared[0]
	_take("neck", "neck", "", -1)
	_take("head", "head", "", _bones.get("neck", -1))
	var low: int = _bones.get("pelvis", -1)
	var top: int = _bones.get("neck", _bones.get("head", -1))
	if low >= 0 and top < 0:
		_find_trunk(low)
	elif low >= 0 and low in _above[top]:
		WayfarerBoneMap.spread_spine(_between(low, top), _bones)
	return _bones


## What follows the last ":" or "|".
static func _last(name: String) -> String:
	return name.substr(maxi(name.rfind(":"), name.rfind("|")) + 1)


## Side and the rest of a name; a helper has no rest.
func _split(words: String) -> void:
	var side := ""
	var rest := ""
	for word in words.to_lower().split(" ", false):
		if word in WayfarerBoneNames.HELPERS:
			side = ""
			rest = ""
			break
		if word in WayfarerBoneNames.LEFT:
			side = "left"
		elif word in WayfarerBoneNames.RIGHT:
			side = "right"
		elif not word in WayfarerBoneNames.NOISE:
			rest += word
	_side.append(side)
	_rest.append(rest)


## The uppermost node of a role's first word that any has, below `inside` (-1: all).
func _take(bone: String, role: String, which: String, inside: int) -> void:
	for word: String in WayfarerBoneNames.ROLES[role]:
		var first := -1
		for k in _rest.size():
			var fits := _rest[k] == word and _side[k] == which and not _taken.has(k)
			if not fits or (inside >= 0 and not inside in _above[k]):
				continue
			if first < 0 or _above[k].size() < _above[first].size():
				first = k
		if first >= 0:
			_bones[bone] = first
			_taken[first] = true
			return


## Nodes with a name between two, from below.
func _between(low: int, top: int) -> PackedInt32Array:
	var found := PackedInt32Array()
	for k in _above[top]:
		if k == low:
			break
		if _rest[k] != "":
			found.append(k)
	found.reverse()
	return found


## Ancestors of both, from below.
func _shared(a: int, b: int) -> Array:
	return Array(_above[a]).filter(func(k: int) -> bool: return k in _above[b])


## Spine, neck and head of a rig that only numbers them, as Rigify: by where arms branch off.
func _find_trunk(pelvis: int) -> void:
	var arms: Array[int] = []
	for which in WayfarerBoneMap.SIDES:
		arms.append(_bones.get(which + "_collar", _bones.get(which + "_shoulder", -1)))
	if arms.min() < 0:
		return
	var shared := _shared(arms[0], arms[1])
	if shared.is_empty() or not pelvis in _above[shared[0]]:
		return
	var chest: int = shared[0]
	var chain := PackedInt32Array()
	var onward := _onward(chest)
	while onward.size() == 1:
		chain.append(onward[0])
		onward = _onward(onward[0])
	var line := _between(pelvis, chest)
	line.append(chest)
	WayfarerBoneMap.spread_spine(line, _bones)
	var box := AABB(_rig.places[0], Vector3.ZERO)
	for place in _rig.places:
		box = box.expand(place)
	var joints := _rig.joints(chain, 0.01 * box.get_longest_axis_size())
	if joints.size() > 1:
		_bones["neck"] = joints[0]
	if not joints.is_empty():
		_bones["head"] = joints[-1]


func _onward(node: int) -> Array:
	return Array(_rig.children[node]).filter(
		func(k: int) -> bool: return _rest[k] != "" and _side[k] == ""
	)
