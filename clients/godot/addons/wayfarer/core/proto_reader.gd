class_name WayfarerProtoReader
extends RefCounted
## A reader for protobuf messages, as much as the motion stream needs
## (https://protobuf.dev/programming-guides/encoding/). After an error it finds no more fields.

const MOST := 0x7FFFFFFF  # of a whole number, except for times

## The error in the message; "": none so far.
var error := ""
var bytes := PackedByteArray()
var at := 0
var _end := 0
var _wire_type := 0


## Begin with a message.
func load_message(message: PackedByteArray) -> void:
	error = ""
	bytes = message
	at = 0
	_end = message.size()


## Move to the next field; its number, or 0 at the end.
func next() -> int:
	if error != "" or at >= _end:
		return 0
	var tag := _raw()
	_wire_type = tag & 7
	if error == "" and tag >> 3 <= 0:
		fail("field number 0")
	return 0 if error != "" else tag >> 3


## Go into an embedded message; give what this returns to `leave` at its end.
func enter() -> int:
	var outer := _end
	var length := block()
	_end = at
	at -= length
	return outer


func leave(outer: int) -> void:
	at = _end
	_end = outer


func varint() -> int:
	return _raw() if _expect(0) else 0


## A whole number up to 2^31; a greater one is an error.
func small() -> int:
	return _checked(varint())


## int32: negative ones come as two's complement of 64 bits.
func int32() -> int:
	return varint()


func real() -> float:
	var start := _fixed(8) if _expect(1) else -1
	return bytes.decode_double(start) if start >= 0 else 0.0


## Skip a field of bytes; returns their number. They end where the reader is.
func block() -> int:
	var length := _raw() if _expect(2) else 0
	return length if _fixed(length) >= 0 else 0


func text() -> String:
	var length := block()
	return bytes.slice(at - length, at).get_string_from_utf8()


## Append a repeated field of floats (size 4) or doubles (8), packed or one at a time.
func reals(size: int, into: PackedFloat64Array) -> void:
	var length := size
	if _wire_type == 2:
		length = block()
		if length % size != 0:
			fail("broken packed field")
	elif not _expect(1 if size == 8 else 5) or _fixed(size) < 0:
		return
	if error != "":
		return
	for start in range(at - length, at, size):
		into.append(bytes.decode_double(start) if size == 8 else bytes.decode_float(start))


## Append a repeated varint field, packed or one at a time. `wide`: above 2^31, too.
func varints(into: PackedInt64Array, wide: bool = false) -> void:
	if _wire_type != 2:
		into.append(varint() if wide else small())
		return
	var outer := enter()
	while at < _end and error == "":
		var value := _raw()
		into.append(value if wide else _checked(value))
	leave(outer)


## Skip the value of a field that is not needed.
func skip() -> void:
	match _wire_type:
		0:
			_raw()
		1:
			_fixed(8)
		2:
			block()
		5:
			_fixed(4)
		_:
			fail("wire type %d" % _wire_type)


func fail(what: String) -> void:
	if error == "":
		error = "malformed message: " + what


func _checked(value: int) -> int:
	if value < 0 or value > MOST:
		fail("a number above 2^31")
	return value


func _expect(wanted: int) -> bool:
	if _wire_type != wanted:
		fail("wire type %d in place of %d" % [_wire_type, wanted])
	return error == ""


func _raw() -> int:
	var value := 0
	for count in 10:
		if at >= _end:
			fail("it ends in a number")
			return 0
		var byte := bytes[at]
		at += 1
		value |= (byte & 0x7F) << (7 * count)
		if byte < 0x80:
			return value
	fail("a number has more than 10 bytes")
	return 0


## Move past a number of bytes; returns where they begin, or -1.
func _fixed(size: int) -> int:
	if size < 0 or size > _end - at:
		fail("a field passes its end")
	if error != "":
		return -1
	at += size
	return at - size
