extends RefCounted
## Checks of tests, and the files they read.

var failures: Array[String] = []
var checks := 0
var golden: String
var _test := ""


func _init(folder: String) -> void:
	golden = folder


func begin(test: String) -> void:
	_test = test


func document(name: String) -> Dictionary:
	return JSON.parse_string(FileAccess.get_file_as_string(golden.path_join(name)))


func message(name: String) -> PackedByteArray:
	return String(document("messages.json")[name]).hex_decode()


func equal(found: Variant, wanted: Variant, what: String = "") -> void:
	checks += 1
	if str(found) != str(wanted):
		failures.append("%s: %s: %s is not %s" % [_test, what, found, wanted])


func holds(right: bool, what: String) -> void:
	checks += 1
	if not right:
		failures.append("%s: %s" % [_test, what])


func near(found: float, wanted: float, within: float, what: String) -> void:
	checks += 1
	if not absf(found - wanted) <= within:
		failures.append("%s: %s: %s is not %s" % [_test, what, found, wanted])


func near_place(found: Vector3, wanted: Array, within: float, what: String) -> void:
	for n in 3:
		near(found[n], wanted[n], within, what)


## Rotations: q and -q are the same.
func near_turn(found: Quaternion, wanted: Array, within: float, what: String) -> void:
	var other := turn(wanted)
	if found.dot(other) < 0.0:
		found = -found
	near(found.x, other.x, within, what)
	near(found.y, other.y, within, what)
	near(found.z, other.z, within, what)
	near(found.w, other.w, within, what)


static func turn(values: Array) -> Quaternion:
	return Quaternion(values[0], values[1], values[2], values[3])


static func place(values: Array) -> Vector3:
	return Vector3(values[0], values[1], values[2])


## hips x, y, z, then x, y, z, w a bone.
static func pose(values: Array) -> WayfarerPose:
	@warning_ignore("integer_division")
	var found := WayfarerPose.new((values.size() - 3) / 4)
	found.hips = place(values)
	for k in found.turns.size():
		found.turns[k] = turn(values.slice(3 + 4 * k, 7 + 4 * k))
	return found


static func rig(nodes: Array) -> WayfarerRig:
	var found := WayfarerRig.new()
	for node: Dictionary in nodes:
		found.add(
			node.name, int(node.parent), place(node.position), turn(node.rotation),
			place(node.scale)
		)
	return found
