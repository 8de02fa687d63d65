class_name WayfarerHomes
extends RefCounted
## The nodes at which sessions, scenes and agents live, as far as is known: the routes of calls when
## a server is many nodes (clients/README.md, "Many nodes").

## The server's address, as http://host:port.
var entry: String

var _homes: Dictionary[String, String] = {}  # addresses by slot


## The addresses to which a call or a stream goes in turn. At most four: the known node, the node it
## names, the entry, and the node that the entry names.
class Route:
	extends RefCounted
	## Where it goes next.
	var address: String

	var _homes: WayfarerHomes
	var _about: String
	var _asked := false  # the entry
	var _followed := false

	## `about`: text with the id that the call concerns; "": none.
	func _init(homes: WayfarerHomes, about: String) -> void:
		_homes = homes
		_about = about
		begin()

	## Start again, as for a new call.
	func begin() -> void:
		address = _homes.home(_about)
		_asked = address == _homes.entry
		_followed = false

	## The call has succeeded, or the stream has begun. `made`: id of what was made by it.
	func answered(made: String = "") -> void:
		if address != _homes.entry:
			_homes.learn(_about if WayfarerHomes.slot_of(made) == "" else made, address)
		begin()

	## Note that `address` has named another node; returns whether the call continues there. Port 0, or
	## an invalid host name: it has named none.
	func misdirected(host: String, port: int) -> bool:
		var strange := RegEx.create_from_string("[^A-Za-z0-9_.:\\[\\]-]").search(host) != null
		if _followed or port <= 0 or port > 65535 or strange:
			return _ask()
		_followed = true
		address = _homes.node(host, port)
		_homes.learn(_about, address)
		return true

	## Note that `address` does not answer at present; returns as `misdirected`.
	func unavailable() -> bool:
		return _ask()

	## Note a refusal, by an HTTP status (0: no answer) and answer. Returns whether the call continues.
	func refused(status: int, answer: Variant) -> bool:
		if status == 421:
			var place: Dictionary = answer.get("endpoint", {}) if answer is Dictionary else {}
			return misdirected(place.get("host", ""), int(place.get("http_port", 0)))
		return status in [0, 503] and unavailable()

	## Note the end of a stream; returns whether to connect to `address` at once.
	func closed(code: int, reason: String) -> bool:
		if code == 4421:
			var place := WayfarerHomes.place_of(reason)
			return misdirected(place[0], place[1])
		unavailable()  # its node may have left the cluster; in any case not at once
		return false

	func _ask() -> bool:
		_homes.forget(_about)
		if _asked:
			return false
		_asked = true
		_followed = false
		address = _homes.entry
		return true


func _init(server: String) -> void:
	entry = server


## The address for calls about the id in a text.
func home(about: String) -> String:
	return _homes.get(slot_of(about), entry)


## A node's address, by the entry's scheme. `host`: "" is the entry's.
func node(host: String, port: int) -> String:
	var own := RegEx.create_from_string("^(https?://|)(\\[[^\\]]*\\]|[^:]*)").search(entry)
	var host_name := "[%s]" % host if ":" in host and not host.begins_with("[") else host  # IPv6
	return "%s%s:%d" % [own.get_string(1), own.get_string(2) if host == "" else host_name, port]


## Note that the slot of `about` lives at `address`.
func learn(about: String, address: String) -> void:
	var slot := slot_of(about)
	if slot != "":
		_homes[slot] = address


## Forget where it lives; only the entry knows.
func forget(about: String) -> void:
	_homes.erase(slot_of(about))


## The slot of the first id in a text, which a session and its agents share; "" without one.
static func slot_of(about: String) -> String:
	var found := RegEx.create_from_string("(?:session|scene|agent)-([0-9a-f]{4})").search(about)
	return found.get_string(1) if found else ""


## Host and port that the close reason of a stream names (code 4421); port 0: none.
static func place_of(reason: String) -> Array:
	var found := RegEx.create_from_string("^call (.*):([0-9]{1,5})$").search(reason)
	return [found.get_string(1), found.get_string(2).to_int()] if found else ["", 0]
