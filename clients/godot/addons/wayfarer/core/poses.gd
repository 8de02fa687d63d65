class_name WayfarerPoses
extends RefCounted
## Packed frames to poses; docs/wire-format.md shows each encoding byte by byte.

enum Encoding { F32_LE = 1, SMALLEST_THREE = 3, ROOT = 4 }

const MIDDLE := 16383  # the count that stands for 0
const STEP := 1.0 / (MIDDLE * 1.4142135623730951)


## Bytes of a frame; 0: the encoding is not known, this client is older than the server.
static func frame_bytes(encoding: int, bones: int) -> int:
	match encoding:
		Encoding.F32_LE:
			return 12 + 16 * bones
		Encoding.SMALLEST_THREE:
			return 12 + 6 * bones
		Encoding.ROOT:
			return 16
	return 0


## `count` frames that begin at byte `start`.
static func unpack(
	bytes: PackedByteArray, start: int, count: int, encoding: int, bones: int
) -> Array[WayfarerPose]:
	var found: Array[WayfarerPose] = []
	var each := frame_bytes(encoding, bones)
	for frame in count:
		var at := start + each * frame
		var pose := WayfarerPose.new(bones)
		pose.hips = Vector3(
			bytes.decode_float(at), bytes.decode_float(at + 4), bytes.decode_float(at + 8)
		)
		if encoding == Encoding.F32_LE:
			_read_floats(bytes.slice(at + 12, at + each).to_float32_array(), pose.turns)
		else:
			_read_smallest(bytes, at + 12, pose.turns)
		found.append(pose)
	return found


static func _read_floats(values: PackedFloat32Array, turns: Array[Quaternion]) -> void:
	for k in turns.size():
		var at := 4 * k
		turns[k] = Quaternion(values[at], values[at + 1], values[at + 2], values[at + 3])


static func _read_smallest(bytes: PackedByteArray, at: int, turns: Array[Quaternion]) -> void:
	for k in turns.size():
		var first := bytes.decode_u16(at)
		var second := bytes.decode_u16(at + 2)
		var a := ((first & 0x7FFF) - MIDDLE) * STEP
		var b := ((second & 0x7FFF) - MIDDLE) * STEP
		var c := ((bytes.decode_u16(at + 4) & 0x7FFF) - MIDDLE) * STEP
		var d := sqrt(maxf(0.0, 1.0 - a * a - b * b - c * c))
		match (first >> 15) | ((second >> 15) << 1):
			0:
				turns[k] = Quaternion(d, a, b, c)
			1:
				turns[k] = Quaternion(a, d, b, c)
			2:
				turns[k] = Quaternion(a, b, d, c)
			_:
				turns[k] = Quaternion(a, b, c, d)
		at += 6
