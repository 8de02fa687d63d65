@icon("res://addons/wayfarer/icon.svg")
class_name WayfarerSession
extends Node3D
## A connection to a server, for walking people. This node is the origin of their world. Characters
## find the session by themselves.

## A session has begun; after a restart of the server, another one.
signal opened(session_id: String)
## An event: a goal is reached, a way is blocked, and others.
signal happened(event: WayfarerStreamDecoder.MotionEvent)
signal agent_added(played: WayfarerMotionPlayer.PlayedAgent)
signal agent_removed(played: WayfarerMotionPlayer.PlayedAgent)

const LEASE_SECONDS := 60.0
const RETRY_SECONDS := 3.0

## The session that was entered last: the one of characters without another.
static var current: WayfarerSession

## Address of the server.
@export var server := "http://localhost:8080"
## API key or JWT, for a server that asks for one. Anyone with your build can read it.
@export var token := ""
## Id of a scene of the server. Empty: an endless floor.
@export var scene := ""
## Id of a session that your program has made, in the basis gltf. Empty: it makes one.
@export var join := ""
## Frames per second that are sent.
@export_enum("40", "20", "10") var fps := "20"
## How rotations are sent: smallest_three takes the fewest bytes.
@export_enum("f32_le", "smallest_three") var encoding := "smallest_three"
## Levels of detail (docs/wire-format.md): rings around the viewport's camera, as
## [{"radius": 15}, {"radius": 300, "format": {"encoding": "root"}}]. Empty: none.
@export var rings: Array[Dictionary] = []

## "": there is none yet.
var id := ""
var api := WayfarerApi.new()
var player := WayfarerMotionPlayer.new()
var stream: WayfarerMotionStream

var _view := Vector3.ZERO
var _opening := false
var _retry_at := 0.0
var _renew_at := 0.0


func _init() -> void:
	process_priority = -100
	add_child(api)


func _enter_tree() -> void:
	current = self


func _exit_tree() -> void:
	if current == self:
		current = null
	if id != "" and join == "":
		_abandon()
	_leave()


func _process(_delta: float) -> void:
	var now := seconds()
	if id == "" and not _opening and now >= _retry_at:
		_open()
	if stream == null:
		return
	stream.update(now)
	if stream == null:
		return
	if join == "" and now >= _renew_at:
		_renew_at = now + LEASE_SECONDS / 3.0
		api.renew_session(id)  # a failure may be temporary; the next call reports a lost session
	player.advance(now)
	var camera := get_viewport().get_camera_3d() if not rings.is_empty() else null
	if camera != null:
		look(place_of(camera.global_position))


## Seconds of the clock of playback, which never goes back.
static func seconds() -> float:
	return Time.get_ticks_usec() / 1e6


## The page of the server that shows this session.
func viewer_url() -> String:
	return "%s/?session=%s" % [api.homes.home(id), id.uri_encode()]


## See the agents from a place of their world, with `rings`, if there is no camera. Call it as often
## as you like: ten calls a second at most are sent, and always the last.
func look(from: Vector3) -> void:
	_view = from
	if stream != null and not rings.is_empty():
		stream.say(JSON.stringify({"viewpoints": _viewpoints()}))


func _viewpoints() -> Array:
	return [{"position": {"x": _view.x, "y": _view.y, "z": _view.z}}]


## A place of the scene in the agents' world.
func place_of(world: Vector3) -> Vector3:
	return global_transform.affine_inverse() * world


func _open() -> void:
	_opening = true
	api.server = server
	api.token = token
	var found := join
	if found == "":
		var reply := await api.create_session(LEASE_SECONDS, scene)
		if reply.error != "":
			push_error("Wayfarer: no session of %s: %s" % [server, reply.error])
			_retry_at = seconds() + RETRY_SECONDS
			_opening = false
			return
		found = reply.data.session_id
	_opening = false
	_begin(found)


func _begin(session_id: String) -> void:
	id = session_id
	_renew_at = seconds() + LEASE_SECONDS / 3.0
	player = WayfarerMotionPlayer.new()
	player.agent_added.connect(agent_added.emit)
	player.agent_removed.connect(agent_removed.emit)
	player.event_received.connect(happened.emit)
	player.header_received.connect(_check_basis)
	var wish := {"encoding": encoding, "fps": fps}
	stream = WayfarerMotionStream.new(
		func(resume: String) -> Dictionary:
			if not rings.is_empty():
				wish.interest = JSON.stringify({"rings": rings, "viewpoints": _viewpoints()})
			return api.stream_address(session_id, wish, resume),
		player,
		func() -> WayfarerSocket: return WayfarerSocket.new(),
		WayfarerHomes.Route.new(api.homes, session_id)
	)
	stream.ended.connect(_lose.bind("has ended"))
	stream.refused.connect(_lose.bind("was refused"))
	stream.failed.connect(_lose.bind("has failed"))
	print("Wayfarer: session %s; to watch it in a browser: %s" % [id, viewer_url()])
	opened.emit(id)


func _check_basis(header: WayfarerStreamDecoder.Header, _again: bool) -> void:
	if header.basis != "gltf":
		push_error("Wayfarer: the session has the basis %s, not gltf" % header.basis)


## Begin another session after a while: the server may have restarted.
func _lose(reason: String, what: String) -> void:
	push_warning("Wayfarer: session %s %s: %s" % [id, what, reason])
	_retry_at = seconds() + RETRY_SECONDS
	_leave()


func _leave() -> void:
	if stream != null:
		stream.close()
	stream = null
	id = ""
	player.clear()


## End the session while this node is freed, by a client that briefly outlives it.
func _abandon() -> void:
	var parts := api.homes.home(id).split("://")
	var host := parts[-1].get_slice(":", 0)
	var secure := parts[0] == "https"
	var port := parts[-1].get_slice(":", 1).to_int() if ":" in parts[-1] else -1
	var client := HTTPClient.new()
	client.connect_to_host(host, port, TLSOptions.client() if secure else null)
	var end := seconds() + 0.5
	var headers := PackedStringArray()
	if token != "":
		headers.append("authorization: Bearer " + token)
	while seconds() < end:
		client.poll()
		if client.get_status() == HTTPClient.STATUS_CONNECTED:
			var path := "/v1/sessions/" + id.uri_encode()
			client.request(HTTPClient.METHOD_DELETE, path, headers)
			client.poll()
			return
		if client.get_status() > HTTPClient.STATUS_CONNECTED:
			return  # it does not answer: the session ends with its lease
		OS.delay_msec(5)
