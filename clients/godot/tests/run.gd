extends SceneTree
## All tests: godot --headless --path clients/godot -s tests/run.gd -- /path/to/tests/golden

const Checks := preload("res://tests/checks.gd")
const SUITES: Array[String] = [
	"test_playout", "test_retarget", "test_messages", "test_stream", "test_homes"
]


func _initialize() -> void:
	var check := Checks.new(OS.get_cmdline_user_args()[0])
	var tests := 0
	for suite in SUITES:
		var script: GDScript = load("res://tests/%s.gd" % suite)
		var object: RefCounted = script.new()
		for method in script.get_script_method_list():
			if String(method.name).begins_with("test_"):
				check.begin("%s.%s" % [suite, method.name])
				object.call(method.name, check)
				tests += 1
	for failure in check.failures:
		print("FAILED ", failure)
	print("%d tests, %d checks, %d failures" % [tests, check.checks, check.failures.size()])
	quit(1 if check.failures else 0)
