class_name WayfarerBonesByName
extends RefCounted
## Bones of a rig by the words of its nodes' names: clients/README.md, "Bones of a character".

const _BREAKS := (
	"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])|(?<=[0-9])(?=[A-Za-z])"
)
# pairs of a role and the role of the bone that it hangs from
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
	var tokens := RegEx.create_from_string("[A-Za-z]+|[^\\x{0}-\\x{7f}]+")
	for k in rig.names.size():
		var found := tokens.search_all(breaks.sub(_last(rig.names[k]), " ", true))
		_split(found.map(func(token: RegExMatch) -> String: return token.get_string()))
		_above.append(rig.ancestors(k))


func find() -> Dictionary[String, int]:
	for which in WayfarerBoneMap.SIDES:
		for limb in _LIMBS:
			var inside: int = _bones.get(which + "_" + limb[1], -1)
			_take(which + "_" + limb[0], limb[0], which, inside)
	_take("neck", "neck", "", -1)
	_take("head", "head", "", _bones.get("neck", -1))
	_take("pelvis", "pelvis", "", -1)
	_find_pelvis()
	_find_spine()
	return _bones


## A node of a limb whose name gives the other side than its bone. "": none, or most names agree
## with the side that was found.
static func contradicted(map: WayfarerBoneMap) -> String:
	var names := WayfarerBonesByName.new(map.rig)
	var against := ""
	var told := 0
	for bone in map.bones:
		var which := bone.get_slice("_", 0)
		var has := names._side[map.bones[bone]]
		if not which in WayfarerBoneMap.SIDES or has == "":
			continue
		told += 1 if has == which else -1
		if has != which and against == "":
			against = map.rig.names[map.bones[bone]]
	return against if told < 0 else ""


## The text after the last ":" or "|".
static func _last(name: String) -> String:
	return name.substr(maxi(name.rfind(":"), name.rfind("|")) + 1)


## Side and the rest of a name; a helper has no rest.
func _split(tokens: Array) -> void:
	_side.append("")
	_rest.append("")
	var words := tokens.map(func(token: String) -> String: return token.to_lower())
	if words.any(func(word: String) -> bool: return word in WayfarerBoneNames.HELPERS):
		return
	for each: String in words:
		var word := _unsided(each, WayfarerBoneNames.LEFT, "left")
		word = _unsided(word, WayfarerBoneNames.RIGHT, "right")
		if not word in WayfarerBoneNames.NOISE:
			_rest[-1] += word


## A token without the side at its start, where words begin with it in scripts without spaces.
func _unsided(token: String, marks: Array, side: String) -> String:
	for mark: String in marks:
		if token == mark or (mark.unicode_at(0) > 127 and token.begins_with(mark)):
			_side[-1] = side
			return token.substr(mark.length())
	return token


## The uppermost node with the first of the role's words that any node has. Nodes below `inside`
## come first. Otherwise it may be anywhere: feet of IK rigs hang from the root. A word of two
## roles, such as "foot", is not looked for there again.
func _take(bone: String, role: String, which: String, inside: int) -> void:
	for within: int in [-1] if inside < 0 else [inside, -1]:
		for word: String in WayfarerBoneNames.ROLES[role]:
			if within < 0 and inside >= 0 and role == "foot" and word == "foot":
				continue
			var first := -1
			for k in _rest.size():
				var fits := _rest[k] == word and _side[k] == which and not _taken.has(k)
				if not fits or (within >= 0 and not within in _above[k]):
					continue
				if first < 0 or _above[k].size() < _above[first].size():
					first = k
			if first >= 0:
				_bones[bone] = first
				_taken[first] = true
				return


## The nodes at the end of the trunk: the neck, or the head, or both arms.
func _top() -> Array[int]:
	for bone: String in ["neck", "head"]:
		if _bones.has(bone):
			return [_bones[bone]]
	var arms: Array[int] = []
	for which in WayfarerBoneMap.SIDES:
		arms.append(_bones.get(which + "_collar", _bones.get(which + "_shoulder", -1)))
	if arms.min() < 0:
		arms.clear()
	return arms


func _thighs() -> Array[int]:
	var found: Array[int] = []
	for which in WayfarerBoneMap.SIDES:
		if _bones.has(which + "_hip"):
			found.append(_bones[which + "_hip"])
	return found


## Moves the pelvis to the lowest node that carries both legs and the trunk.
func _find_pelvis() -> void:
	var legs := _thighs()
	if legs.size() < 2:
		return
	for carried: Array[int] in [legs + _top(), legs]:
		var shared := _shared(carried)
		if _bones.get("pelvis", -1) in shared:
			return
		if not shared.is_empty():
			_bones["pelvis"] = shared[0]
			return


## The common ancestors of these nodes, from below.
func _shared(nodes: Array[int]) -> Array:
	return Array(_above[nodes[0]]).filter(
		func(k: int) -> bool: return nodes.all(func(n: int) -> bool: return k in _above[n])
	)


## The trunk's bones, from which no thigh hangs. Where rigs only number them, with neck and head, as
## Rigify does, where arms branch off tells them apart.
func _find_spine() -> void:
	var top := _top()
	if top.is_empty() or not _bones.has("pelvis"):
		return
	if top.size() == 1:
		WayfarerBoneMap.spread_spine(_trunk(top[0]), _bones)
		return
	var shared := _shared(top)
	if shared.is_empty() or not _bones["pelvis"] in _above[shared[0]]:
		return
	var chest: int = shared[0]
	var chain := PackedInt32Array()
	var onward := _onward(chest)
	while onward.size() == 1:
		chain.append(onward[0])
		onward = _onward(onward[0])
	var line := _trunk(chest)
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


## Named nodes below this one, from the lowest, except ancestors of thighs.
func _trunk(top: int) -> PackedInt32Array:
	var legs := _thighs()
	var found := PackedInt32Array()
	for k in _above[top]:
		if legs.any(func(leg: int) -> bool: return k in _above[leg]):
			break
		if _rest[k] != "" and _side[k] == "":
			found.append(k)
	found.reverse()
	return found


func _onward(node: int) -> Array:
	return Array(_rig.children[node]).filter(
		func(k: int) -> bool: return _rest[k] != "" and _side[k] == ""
	)
