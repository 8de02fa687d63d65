class_name WayfarerBonesByShape
extends RefCounted
## Bones of a rig by its shape: legs end lowest, the spine goes up between them, arms branch to both
## sides of it.

const _LEG: Array[String] = ["hip", "knee", "ankle", "foot"]
const _ARM: Array[String] = ["collar", "shoulder", "elbow", "wrist"]

const _LOW := 0.1  # of the rig's height: a branch that ends below this reaches the ground
const _APART := 0.05  # of that height: least distance between the ends of two legs
const _TOES := 0.02  # of that height: least distance of toes before the ankle
const _FAR := 0.25  # of that height: least distance between two pairs of legs

var _rig: WayfarerRig
var _basis: WayfarerBasis
var _height := PackedFloat64Array()
var _tall := 0.0
var _below: Array[PackedInt32Array] = []
var _bones: Dictionary[String, int] = {}
# a node, and the joints of two branches of at least three that reach the ground apart: [k, a, b]
var _pairs: Array[Array] = []


func _init(rig: WayfarerRig, basis: WayfarerBasis) -> void:
	_rig = rig
	_basis = basis
	for k in _rig.places.size():
		_height.append(_rig.places[k].dot(_basis.up))
		_below.append(_rig.subtree(k))
	if _height.is_empty():
		return
	var floor_height: float = Array(_height).min()
	_tall = Array(_height).max() - floor_height
	var lowest := PackedInt32Array()
	for k in _height.size():
		lowest.append(_most(_below[k], func(n: int) -> float: return -_height[n]))
	for k in _height.size() if _tall > 0.0 else 0:
		var feet := Array(_rig.children[k]).filter(
			func(n: int) -> bool: return _height[lowest[n]] < floor_height + _LOW * _tall
		)
		for a in feet.size():
			for b in range(a + 1, feet.size()):
				var gap := _rig.places[lowest[feet[a]]] - _rig.places[lowest[feet[b]]]
				if _basis.level(gap).length() <= _APART * _tall:
					continue
				var chains := [feet[a], feet[b]].map(
					func(leg: int) -> PackedInt32Array:
						return _rig.joints(_rig.path(leg, lowest[leg]), 0.03 * _tall)
				)
				if mini(chains[0].size(), chains[1].size()) >= 3:
					_pairs.append([k, chains[0], chains[1]])


## The bones that the shape reveals, enough for a humanoid or not.
func find() -> Dictionary[String, int]:
	var walking := _pairs.filter(
		func(pair: Array) -> bool:
			return minf(_toes(pair[1]).length(), _toes(pair[2]).length()) >= _TOES * _tall
	)
	# parents come first: the deepest. Without toes a skirt looks like legs
	if not walking.is_empty():
		var chains: Array[PackedInt32Array] = [walking[-1][1], walking[-1][2]]
		_find_all(walking[-1][0], chains)
	return _bones


## A pair of legs of the same body that hangs far from these two thighs; empty: none does.
func other_legs(pelvis: int, hips: PackedInt32Array) -> PackedInt32Array:
	var line := _below[pelvis] + _rig.ancestors(pelvis)
	var own := hips + _rig.ancestors(hips[0]) + _rig.ancestors(hips[1])
	for pair in _pairs:
		var a: int = pair[1][0]
		var b: int = pair[2][0]
		if not pair[0] in line or a in own or b in own:
			continue
		var away := _rig.places[a] + _rig.places[b] - _rig.places[hips[0]] - _rig.places[hips[1]]
		if _basis.level(away).length() / 2.0 > _FAR * _tall:
			return PackedInt32Array([a, b])
	return PackedInt32Array()


## Where the toes of a leg point, level.
func _toes(chain: PackedInt32Array) -> Vector3:
	return _basis.level(_rig.places[chain[mini(3, chain.size() - 1)]] - _rig.places[chain[2]])


func _find_all(pelvis: int, chains: Array[PackedInt32Array]) -> void:
	var forward := _toes(chains[0]) + _toes(chains[1])
	if forward.length() < 0.01 * _tall:
		return
	var left := _basis.handed * _basis.up.cross(forward)
	if _basis.level(_rig.places[chains[0][0]] - _rig.places[chains[1][0]]).dot(left) < 0.0:
		chains.reverse()
	_bones["pelvis"] = pelvis
	for s in 2:
		for k in mini(_LEG.size(), chains[s].size()):
			_bones[WayfarerBoneMap.SIDES[s] + "_" + _LEG[k]] = chains[s][k]
	var top := _most(_below[pelvis], func(n: int) -> float: return _height[n])
	_find_upper(_rig.path(pelvis, top).slice(1), left.normalized())


func _find_upper(spine: PackedInt32Array, left: Vector3) -> void:
	for k in spine.size():
		var chest := spine[k]
		var both: Array[int] = [-1, -1]
		var ends: Array[int] = [-1, -1]
		for arm in _rig.children[chest]:
			if arm in spine:
				continue
			var end := _most(
				_below[arm], func(n: int) -> float: return absf(_rig.places[n].dot(left))
			)
			var out := (_rig.places[end] - _rig.places[chest]).dot(left)
			var s := 0 if out > 0.0 else 1
			if absf(out) > 0.15 * _tall and both[s] < 0:
				both[s] = arm
				ends[s] = end
		if both.min() < 0:
			continue
		WayfarerBoneMap.spread_spine(spine.slice(0, k + 1), _bones)
		for s in 2:
			var line := _rig.joints(_rig.path(both[s], ends[s]), 0.02 * _tall)
			_find_arm(WayfarerBoneMap.SIDES[s], line)
		var rest := _rig.joints(spine.slice(k + 1), 0.01 * _tall)
		if rest.size() > 1:
			_bones["neck"] = rest[0]
		if not rest.is_empty():
			_bones["head"] = rest[mini(1, rest.size() - 1)]
		return
	WayfarerBoneMap.spread_spine(spine.slice(0, 1), _bones)


func _find_arm(side: String, line: PackedInt32Array) -> void:
	var chain := PackedInt32Array()
	for node in line:
		chain.append(node)
		if _rig.children[node].size() >= 3:
			break  # the hand: fingers begin
	var names := _ARM.slice(0 if chain.size() >= 4 else 1)
	var ends := chain.slice(maxi(0, chain.size() - 4))
	for n in mini(names.size(), ends.size()):
		_bones[side + "_" + names[n]] = ends[n]


## The first node with the greatest measure.
static func _most(nodes: PackedInt32Array, measure: Callable) -> int:
	var best := nodes[0]
	for node in nodes:
		if measure.call(node) > measure.call(best):
			best = node
	return best
