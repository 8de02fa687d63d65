class_name WayfarerSocket
extends RefCounted
## A WebSocket of the engine, with larger buffers: the engine's own 64 kB would lose a batch of more
## than 64 agents.

const BUFFER := 1 << 23  # bytes: half a minute of 64 agents
const PACKETS := 4096

var _peer := WebSocketPeer.new()
var _failed := ""


## Connect; `closed` shows a failure.
func open(url: String, protocols: PackedStringArray) -> void:
	_peer.inbound_buffer_size = BUFFER
	_peer.max_queued_packets = PACKETS
	_peer.supported_protocols = protocols
	var error := _peer.connect_to_url(url)
	if error != OK:
		_failed = "%s: %s" % [url, error_string(error)]


## Take all messages; never waits.
func poll() -> void:
	_peer.poll()


## The next message, or nothing.
func next() -> PackedByteArray:
	return _peer.get_packet() if _peer.get_available_packet_count() > 0 else PackedByteArray()


## Send a text once it is open; an unsent text is lost with the connection.
func say(text: String) -> void:
	_peer.send_text(text)


func closed() -> bool:
	return _failed != "" or _peer.get_ready_state() == WebSocketPeer.STATE_CLOSED


## Code of the close; -1: the connection is lost.
func close_code() -> int:
	return -1 if _failed != "" else _peer.get_close_code()


func close_reason() -> String:
	return _failed if _failed != "" else _peer.get_close_reason()


func close() -> void:
	_peer.close()
