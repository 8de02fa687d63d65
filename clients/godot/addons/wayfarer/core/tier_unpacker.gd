class_name WayfarerTierUnpacker
extends RefCounted
## Frames of each tier of a stream, as poses with the bones of the first (clients/README.md, "Far
## people").

const BONES := 22
const POSES := 16
const TURN_UNIT := PI / 32768.0

## Why the header cannot be read; "": no error.
var error := ""

var _bones: PackedInt64Array
var _tiers: Array[WayfarerStreamDecoder.Tier]
var _slots: Array[PackedInt64Array] = []  # by tier: place of each bone in its frames; -1: none
var _stand: Array[Quaternion] = []
var _cycle: Array[Quaternion] = []
var _up: Vector3


func _init(header: WayfarerStreamDecoder.Header) -> void:
	var known := header.basis in WayfarerBasis.NAMES
	var basis := WayfarerBasis.new(header.basis if known else "gltf")
	_up = basis.up
	_bones = header.bones
	_tiers = header.tiers
	_stand = _turned(WayfarerGaitTable.STAND, basis)
	_cycle = _turned(WayfarerGaitTable.CYCLE, basis)
	for tier in _tiers:
		if WayfarerPoses.frame_bytes(tier.encoding, tier.bones.size()) == 0:
			error = (
				"pose encoding %d is not known: this client is older than the server"
				% tier.encoding
			)
		var slots := PackedInt64Array()
		for bone in _bones:
			slots.append(tier.bones.find(bone))
		_slots.append(slots)


## `count` frames of a tier that begin at byte `start`.
func unpack(bytes: PackedByteArray, start: int, count: int, tier: int) -> Array[WayfarerPose]:
	var encoding := _tiers[tier].encoding
	var sent := _tiers[tier].bones
	if encoding == WayfarerPoses.Encoding.ROOT:
		var drawn: Array[WayfarerPose] = []
		for frame in count:
			drawn.append(_root(bytes, start + 16 * frame))
		return drawn
	var poses := WayfarerPoses.unpack(bytes, start, count, encoding, sent.size())
	if sent == _bones:
		return poses
	for k in count:
		var whole := WayfarerPose.new(_bones.size())
		whole.hips = poses[k].hips
		for n in _bones.size():
			var slot := _slots[tier][n]
			whole.turns[n] = _standing(_bones[n]) if slot < 0 else poses[k].turns[slot]
		poses[k] = whole
	return poses


func _root(bytes: PackedByteArray, at: int) -> WayfarerPose:
	var pose := WayfarerPose.new(_bones.size())
	pose.hips = Vector3(
		bytes.decode_float(at), bytes.decode_float(at + 4), bytes.decode_float(at + 8)
	)
	var half := bytes.decode_s16(at + 12) * TURN_UNIT / 2.0
	var phase := bytes.decode_u8(at + 14) / 256.0 * POSES
	var share := minf(1.0, bytes.decode_u8(at + 15) / 128.0 / WayfarerGaitTable.SWING)
	var number := int(phase)
	for k in _bones.size():
		var bone := _bones[k]
		pose.turns[k] = _standing(bone)
		if bone >= BONES:
			continue
		var before := _cycle[BONES * number + bone]
		var after := _cycle[BONES * ((number + 1) % POSES) + bone]
		pose.turns[k] = _mixed(pose.turns[k], _mixed(before, after, phase - number), share)
		if bone == 0:
			var axis := sin(half) * _up
			pose.turns[k] = Quaternion(axis.x, axis.y, axis.z, cos(half)) * pose.turns[k]
	return pose


func _standing(bone: int) -> Quaternion:
	return _stand[bone] if bone < BONES else Quaternion.IDENTITY


## Interpolates linearly along the shorter arc, normalised.
static func _mixed(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
	return (a * (1.0 - share) + b * (-share if a.dot(b) < 0.0 else share)).normalized()


static func _turned(table: Array[float], basis: WayfarerBasis) -> Array[Quaternion]:
	var found: Array[Quaternion] = []
	for k in range(0, table.size(), 4):
		var axis := table[k] * basis.left + table[k + 1] * basis.up + table[k + 2] * basis.forward
		axis *= basis.handed
		found.append(Quaternion(axis.x, axis.y, axis.z, table[k + 3]))
	return found
