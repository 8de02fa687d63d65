extends RefCounted
## A stream over sockets and a clock that the test drives by hand.

const Checks := preload("res://tests/checks.gd")


class FakeSocket:
	extends RefCounted
	var url := ""
	var messages: Array[PackedByteArray] = []
	var code := 0
	var reason := ""
	var is_closed := false
	var sent: Array[String] = []

	func open(to: String, _protocols: PackedStringArray) -> void:
		url = to

	func poll() -> void:
		pass

	func say(text: String) -> void:
		sent.append(text)

	func next() -> PackedByteArray:
		return messages.pop_front() if not messages.is_empty() else PackedByteArray()

	func closed() -> bool:
		return code != 0

	func close_code() -> int:
		return code

	func close_reason() -> String:
		return reason

	func close() -> void:
		is_closed = true


class Harness:
	var sockets: Array[FakeSocket] = []
	var heard: Array[String] = []
	var player := WayfarerMotionPlayer.new()
	var stream: WayfarerMotionStream

	func _init(route: WayfarerHomes.Route = null) -> void:
		stream = WayfarerMotionStream.new(
			func(token: String) -> Dictionary:
				return {"url": "ws://x/" + token, "protocols": PackedStringArray(["p"])},
			player,
			func() -> FakeSocket:
				sockets.append(FakeSocket.new())
				return sockets[-1],
			route
		)
		stream.status_changed.connect(
			func(status: String, _detail: String) -> void: heard.append(status)
		)
		stream.ended.connect(func(reason: String) -> void: heard.append("ended " + reason))
		stream.refused.connect(func(reason: String) -> void: heard.append("refused " + reason))
		stream.failed.connect(func(reason: String) -> void: heard.append("failed " + reason))
		stream.update(0.0)

	func end(code: int, reason: String = "") -> void:
		sockets[-1].code = code
		sockets[-1].reason = reason


func test_a_lost_connection_is_opened_again_later_each_time(check: Checks) -> void:
	var harness := Harness.new()
	harness.end(-1)
	harness.stream.update(1.0)
	harness.stream.update(1.49)
	check.equal(harness.sockets.size(), 1)
	harness.stream.update(1.5)
	check.equal(harness.sockets.size(), 2)
	harness.end(4503)
	harness.stream.update(2.0)
	harness.stream.update(2.9)
	check.equal(harness.sockets.size(), 2)
	harness.stream.update(3.0)
	harness.sockets[-1].messages.append(check.message("header"))
	harness.end(1001)
	harness.stream.update(3.1)
	harness.stream.update(3.6)
	check.equal(harness.sockets.size(), 4)
	check.equal(
		" ".join(harness.heard), "connecting lost connecting lost connecting open lost connecting"
	)


func test_a_stream_goes_on_where_it_was(check: Checks) -> void:
	var harness := Harness.new()
	harness.sockets[0].messages.append(check.message("header"))
	harness.sockets[0].messages.append(check.message("batch"))
	harness.end(-1)
	harness.stream.update(0.1)
	harness.stream.update(0.7)
	check.equal(harness.sockets[1].url, "ws://x/r.1.41")


func test_a_resume_token_that_the_server_does_not_know_is_forgotten(check: Checks) -> void:
	var harness := Harness.new()
	harness.sockets[0].messages.append(check.message("header"))
	harness.sockets[0].messages.append(check.message("batch"))
	harness.end(4422, "not a resume token")
	harness.stream.update(0.1)
	check.equal(harness.sockets[1].url, "ws://x/")
	harness.end(4422, "encoding: unknown")
	harness.stream.update(0.2)
	harness.stream.update(100.0)
	check.equal([harness.heard[-1], harness.sockets.size()], ["failed encoding: unknown", 2])


func test_what_is_for_good(check: Checks) -> void:
	var told := {1000: "ended x", 4404: "ended x", 4401: "refused x", 4403: "failed x"}
	for code: int in told:
		var harness := Harness.new()
		harness.end(code, "x")
		harness.stream.update(0.1)
		harness.stream.update(100.0)
		check.equal([harness.heard[-1], harness.sockets.size()], [told[code], 1], str(code))
		harness.stream.open()
		harness.stream.update(100.1)
		check.equal(harness.sockets.size(), 2)


func test_a_silent_connection_is_given_up_a_speaking_one_is_kept(check: Checks) -> void:
	var harness := Harness.new()
	harness.stream.update(2.0)
	harness.sockets[0].messages.append(check.message("header"))
	harness.stream.update(4.0)
	harness.stream.update(6.4)
	check.equal(harness.sockets[0].is_closed, false)
	harness.stream.update(6.6)
	check.equal([harness.sockets[0].is_closed, harness.heard[-1]], [true, "lost"])


func test_what_cannot_be_read_ends_the_stream_with_a_reason(check: Checks) -> void:
	var harness := Harness.new()
	harness.sockets[0].messages.append(PackedByteArray([0x0b]))
	harness.stream.update(0.1)
	check.holds("cannot read the stream: malformed message" in harness.heard[-1], harness.heard[-1])
	harness.stream.update(100.0)
	check.equal(harness.sockets.size(), 1)


func test_texts_are_sent_once_the_header_has_come_the_last_of_a_tenth_of_a_second(
	check: Checks
) -> void:
	var harness := Harness.new()
	harness.stream.say("a")
	harness.stream.update(0.1)
	check.equal(harness.sockets[0].sent, [])
	harness.sockets[0].messages.append(check.message("header"))
	harness.stream.update(0.2)
	harness.stream.say("b")
	harness.stream.say("c")
	harness.stream.update(0.25)
	harness.stream.update(0.31)
	harness.stream.say("c")
	harness.stream.update(1.0)
	check.equal(harness.sockets[0].sent, ["a", "c"])


func test_the_sockets_buffers_are_raised(check: Checks) -> void:
	check.holds(WayfarerSocket.BUFFER > 1 << 20, "more than the engine's 65,535 bytes")
	var socket := WayfarerSocket.new()
	socket.open("ws://127.0.0.1:1", PackedStringArray(["wayfarer.v1"]))
	check.equal(socket._peer.inbound_buffer_size, WayfarerSocket.BUFFER)
	socket.close()


func test_a_stream_that_is_sent_on_follows_at_once_and_asks_the_entry_later(check: Checks) -> void:
	var homes := WayfarerHomes.new("http://entry:1")
	var harness := Harness.new(WayfarerHomes.Route.new(homes, "session-00ff12"))
	harness.end(4421, "call a:7")
	harness.stream.update(0.1)
	check.equal([harness.sockets.size(), homes.home("session-00ff12")], [2, "http://a:7"])
	harness.sockets[-1].messages.append(check.message("header"))
	harness.end(1006, "")
	harness.stream.update(0.2)
	check.equal([harness.sockets.size(), homes.home("session-00ff12")], [2, "http://entry:1"])
	harness.stream.update(0.8)
	check.equal(harness.sockets.size(), 3)
	check.equal(" ".join(harness.heard), "connecting connecting open lost connecting")
