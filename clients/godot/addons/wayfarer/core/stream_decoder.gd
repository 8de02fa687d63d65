class_name WayfarerStreamDecoder
extends RefCounted
## Reads StreamMotionResponse (proto/wayfarer/v1/motion.proto) from bytes, and holds the last
## message. Times are seconds since 1970, by the server's clock.

## Flags of a chunk; `flags` is a sum of them.
enum Flag { FIRST = 1, REPLANNED = 2, ARRIVED = 4, GAP = 8, REDUCED = 16, HELD = 32 }

const STATES: Array[String] = ["unknown", "standing", "walking", "stopping", "turning"]
const EVENTS: Array[String] = [
	"unknown", "goal_reached", "path_done", "gap", "draining", "model_changed", "unreachable",
	"blocked", "goal_moved", "behaviour_ended", "agent_left", "fault",
]
const BASES: Array[String] = [
	"gltf", "gltf", "unity", "unreal", "unreal_mannequin", "blender", "ros"
]


## How frames are packed in a ring around the viewpoints.
class Tier:
	var radius := INF  ## in units of the basis; INF without rings
	var encoding := 0
	var sent_fps := 0
	var bones := PackedInt64Array()
	var frame_bytes := 0


## Properties of a whole stream.
class Header:
	var server_version := ""
	var session_id := ""
	var fps := 0  ## of the motion
	var sent_fps := 0  ## sent per second
	var basis := "gltf"
	var metres_per_unit := 1.0
	var skeleton: Array[Dictionary] = []  ## {name, parent}
	var bones := PackedInt64Array()  ## numbers in `skeleton` of the bones whose rotations are sent
	var encoding := 0
	var frame_bytes := 0
	var resumed := false
	var tiers: Array[Tier] = []  ## from the inside out; one without rings


## An agent as the stream introduces it.
class Agent:
	var id := ""
	var alias := 0
	var name := ""
	var body := ""
	var gender := "female"
	var betas := PackedFloat64Array()
	var seed_number := 0
	var rest_offsets := PackedFloat64Array()  ## x, y, z for each bone of the skeleton


## The new frames of an agent.
class Chunk:
	var alias := 0
	var seq := 0
	var first_frame := 0
	var scheduled_at := 0.0
	var goal_revision := 0
	var state := ""
	var flags := 0
	var waypoint := 0
	var candidates := 0
	var frames := 0  ## how many
	var poses := 0  ## where they begin in the message
	var contacts := 0  ## where they begin: a byte for each frame, 1 left foot, 2 right foot


## Something that happened.
class MotionEvent:
	var kind := "unknown"
	var agent_id := ""
	var alias := 0
	var at := 0.0
	var goal_revision := 0
	var waypoint := 0
	var detail := ""  ## a sentence for people


var kind := ""  ## "header", "batch", "heartbeat", "event", ""; "error": see `error`
var error := ""
var sent_at := 0.0
var header: Header
var event: MotionEvent
var added: Array[Agent] = []  ## seen for the first time
var removed := PackedInt64Array()  ## aliases of deleted agents
var hidden := PackedInt64Array()  ## aliases of agents that have left the last ring
var tier := 0  ## of the chunks: index into the header's
var resume_token := ""  ## of the last batch that had one
var chunks := 0  ## number of chunks of the batch

var _reader := WayfarerProtoReader.new()
var _columns: Array[PackedInt64Array] = []  # of MotionChunks, by number of the field
var _poses := 0
var _poses_length := 0
var _contacts := 0
var _contacts_length := 0


## The message's bytes, in which poses and contacts of a chunk are places.
func bytes() -> PackedByteArray:
	return _reader.bytes


## Read a message; returns its kind.
func decode(message: PackedByteArray) -> String:
	_reader.load_message(message)
	kind = ""
	sent_at = 0.0
	header = null
	event = null
	added = []
	removed = PackedInt64Array()
	hidden = PackedInt64Array()
	tier = 0
	chunks = 0
	_columns = []
	for field in 12:
		_columns.append(PackedInt64Array())
	_poses_length = 0
	_contacts_length = 0
	var field := _reader.next()
	while field != 0:
		_read(field)
		field = _reader.next()
	if _reader.error == "":
		_check()
	error = _reader.error
	if error != "":
		kind = "error"
	return kind


## Chunk `row` of the batch.
func chunk(row: int) -> Chunk:
	var found := Chunk.new()
	found.alias = _columns[1][row]
	found.seq = _columns[2][row]
	found.first_frame = _columns[3][row]
	found.scheduled_at = _columns[4][row] / 1e6
	found.goal_revision = _columns[5][row]
	found.state = _name_of(STATES, _columns[6][row])
	found.flags = _columns[7][row]
	found.waypoint = _columns[10][row]
	found.candidates = _columns[11][row]
	@warning_ignore("integer_division")
	found.frames = _contacts_length / chunks
	@warning_ignore("integer_division")
	found.poses = _poses + _poses_length / chunks * row
	found.contacts = _contacts + found.frames * row
	return found


## The error in the frames of the batch, or in a header's layout; "": none.
func check_frames(of: Header) -> String:
	if tier >= of.tiers.size():
		return "the header tells of %d tiers, not of %d" % [of.tiers.size(), tier]
	var packing := of.tiers[tier]
	var each := WayfarerPoses.frame_bytes(packing.encoding, packing.bones.size())
	if _poses_length != each * _contacts_length:
		return "%d bytes of poses are not %d frames of %d bytes" % [
			_poses_length, _contacts_length, each
		]
	return ""


func _read(field: int) -> void:
	match field:
		1:
			sent_at = _reader.varint() / 1e6
		2:
			header = _read_header()
			kind = "header"
		3:
			_read_batch()
			kind = "batch"
		4:
			_reader.block()
			kind = "heartbeat"
		5:
			event = _read_event()
			kind = "event"
		_:
			_reader.skip()


func _read_batch() -> void:
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1:
				added.append(_read_agent())
			2:
				_read_chunks()
			3:
				_reader.varints(removed)
			4:
				resume_token = _reader.text()
			5:
				tier = _reader.small()
			6:
				_reader.varints(hidden)
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)


func _read_chunks() -> void:
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1, 2, 3, 4, 5, 6, 7, 10, 11:
				_reader.varints(_columns[field], field == 4)
			8:
				_poses_length = _reader.block()
				_poses = _reader.at - _poses_length
			9:
				_contacts_length = _reader.block()
				_contacts = _reader.at - _contacts_length
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)
	chunks = _columns[1].size()


func _check() -> void:
	var count := maxi(1, chunks)
	var whole := _poses_length % count == 0 and _contacts_length % count == 0
	for field: int in [1, 2, 3, 4, 5, 6, 7, 10, 11]:
		whole = whole and _columns[field].size() == chunks
	if not whole:
		_reader.fail("columns of chunks differ in length")


func _read_header() -> Header:
	var found := Header.new()
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1:
				found.server_version = _reader.text()
			2:
				found.session_id = _reader.text()
			3:
				found.fps = _reader.small()
			4:
				_read_basis(found)
			5:
				_read_skeleton(found)
			6:
				found.encoding = _reader.small()
			7:
				found.sent_fps = _reader.small()
			8:
				_reader.varints(found.bones)
			9:
				found.frame_bytes = _reader.small()
			11:
				found.resumed = _reader.varint() != 0
			12:
				found.tiers.append(_read_tier())
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)
	if found.tiers.is_empty():
		var only := Tier.new()
		only.encoding = found.encoding
		only.sent_fps = found.sent_fps
		only.bones = found.bones
		only.frame_bytes = found.frame_bytes
		found.tiers.append(only)
	if found.encoding == WayfarerPoses.Encoding.ROOT:
		found.bones = PackedInt64Array(range(22))  # drawn with the bones of a body
	return found


func _read_tier() -> Tier:
	var found := Tier.new()
	found.radius = 0.0
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1:
				found.radius = _reader.real()
			2:
				found.encoding = _reader.small()
			3:
				found.sent_fps = _reader.small()
			4:
				_reader.varints(found.bones)
			5:
				found.frame_bytes = _reader.small()
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)
	return found


func _read_basis(into: Header) -> void:
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1:
				into.basis = _name_of(BASES, _reader.varint(), "unknown")
			2:
				into.metres_per_unit = _reader.real()
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)


func _read_skeleton(into: Header) -> void:
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		if field == 1:
			into.skeleton.append(_read_bone())
		else:
			_reader.skip()
		field = _reader.next()
	_reader.leave(outer)


func _read_bone() -> Dictionary:
	var bone := {"name": "", "parent": 0}
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1:
				bone.name = _reader.text()
			2:
				bone.parent = _reader.int32()
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)
	return bone


func _read_agent() -> Agent:
	var agent := Agent.new()
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1:
				agent.id = _reader.text()
			2:
				agent.alias = _reader.small()
			4:
				agent.name = _reader.text()
			5:
				agent.body = _reader.text()
			6:
				agent.gender = "male" if _reader.varint() == 2 else "female"
			7:
				_reader.reals(8, agent.betas)
			8:
				agent.seed_number = _reader.varint()
			15:
				_reader.reals(4, agent.rest_offsets)
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)
	return agent


func _read_event() -> MotionEvent:
	var found := MotionEvent.new()
	var outer := _reader.enter()
	var field := _reader.next()
	while field != 0:
		match field:
			1:
				found.kind = _name_of(EVENTS, _reader.varint())
			2:
				found.agent_id = _reader.text()
			3:
				found.alias = _reader.small()
			4:
				found.at = _reader.varint() / 1e6
			5:
				found.goal_revision = _reader.small()
			6:
				found.waypoint = _reader.small()
			7:
				found.detail = _reader.text()
			_:
				_reader.skip()
		field = _reader.next()
	_reader.leave(outer)
	return found


static func _name_of(names: Array[String], number: int, other: String = "unknown") -> String:
	return names[number] if number >= 0 and number < names.size() else other
