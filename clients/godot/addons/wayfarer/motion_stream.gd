class_name WayfarerMotionStream
extends RefCounted
## Brings a session's motion to a player. A lost connection is restored and resumes where it was. It
## reads no clock; everything happens in `update`.

## "connecting", "open", "lost", and why.
signal status_changed(status: String, detail: String)
## The session is gone.
signal ended(reason: String)
## The caller must authenticate; it may then `open` again.
signal refused(reason: String)
## Another attempt is pointless.
signal failed(reason: String)

const RETRY_FIRST := 0.5  # seconds; doubled at each failure
const RETRY_MOST := 8.0
const PAUSE := 0.1  # least seconds between two texts
const SILENCE := 2.5  # seconds without a heartbeat (one per second) that mean a dead connection
const GONE := 1000
const INVALID := 4422
const UNKNOWN_CALLER := 4401
const FORBIDDEN := 4403
const NOT_FOUND := 4404

## Whether it has stopped: after `close`, `ended`, `refused` or `failed`.
var closed := false

var _address: Callable
var _player: WayfarerMotionPlayer
var _new_socket: Callable
var _route: WayfarerHomes.Route
var _socket: RefCounted
var _retry := RETRY_FIRST
var _retry_at := -INF
var _heard_at := 0.0
var _text := ""  # waiting to be sent
var _said := ""
var _said_at := -INF
var _begun := false  # this connection's header has come
var _forgotten := ""  # a resume token unknown to the server


## `address(resume_token)` returns {url, protocols}; `new_socket()` returns a WayfarerSocket, or one
## like it. `route` receives the outcome of an address; null: there is only one.
func _init(
	address: Callable,
	player: WayfarerMotionPlayer,
	new_socket: Callable = func() -> WayfarerSocket: return WayfarerSocket.new(),
	route: WayfarerHomes.Route = null
) -> void:
	_route = route
	_address = address
	_player = player
	_new_socket = new_socket


## Connect at the next update, after the stream was refused.
func open() -> void:
	closed = false
	_retry = RETRY_FIRST
	_retry_at = -INF


## Send a text. Only the last within a tenth of a second is sent, and none twice.
func say(text: String) -> void:
	if text != _said:
		_text = text
		_said = text


## Take all messages until `now` (seconds), and maintain the connection. Never waits.
func update(now: float) -> void:
	if not closed and _socket == null and now >= _retry_at:
		if _route != null:
			_route.begin()
		_connect(now)
	if not closed and _socket != null:
		_socket.poll()
	while not closed and _socket != null:
		var message: PackedByteArray = _socket.next()
		if message.is_empty():
			break
		_receive(message, now)
	if not closed and _socket != null and _socket.closed():
		_take_loss(_socket.close_code(), _socket.close_reason(), now)
	if _begun and not closed and _socket != null and _text != "" and now - _said_at >= PAUSE:
		_socket.say(_text)
		_text = ""
		_said_at = now
	if now - _heard_at > SILENCE:  # half-open: it would never close by itself
		reconnect("nothing has come for %.1f s" % SILENCE, now)


## Close the stream.
func close() -> void:
	closed = true
	_drop()


## Connect again, as after a loss: the network may have changed.
func reconnect(reason: String, now: float) -> void:
	if not closed and _socket != null:
		_take_loss(-1, reason, now)


func _connect(now: float) -> void:
	status_changed.emit("connecting", "")
	_player.begin()
	_begun = false
	var token := _player.resume_token()
	var where: Dictionary = _address.call("" if token == _forgotten else token)
	_heard_at = now
	_socket = _new_socket.call()
	_socket.open(where.url, where.protocols)


func _receive(message: PackedByteArray, now: float) -> void:
	_heard_at = now
	match _player.receive(message, now):
		"error":
			close()
			failed.emit("cannot read the stream: " + _player.error)
		"header":
			_retry = RETRY_FIRST
			_begun = true
			if _route != null:
				_route.answered()
			status_changed.emit("open", "")


func _take_loss(code: int, reason: String, now: float) -> void:
	_drop()
	var token := _player.resume_token()
	if code == INVALID and token != _forgotten:
		_forgotten = token  # perhaps of another server: begin with the frames due next
		_connect(now)
		return
	closed = code in [GONE, NOT_FOUND, UNKNOWN_CALLER, FORBIDDEN, INVALID]
	if not closed and _route != null and _route.closed(code, reason):
		_connect(now)
	elif not closed:
		_retry_at = now + _retry
		_retry = minf(RETRY_MOST, 2.0 * _retry)
		status_changed.emit("lost", reason)
	elif code == UNKNOWN_CALLER:
		refused.emit(reason)
	elif code in [GONE, NOT_FOUND]:
		ended.emit(reason)
	else:
		failed.emit(reason)


func _drop() -> void:
	if _socket != null:
		_socket.close()
	_socket = null
