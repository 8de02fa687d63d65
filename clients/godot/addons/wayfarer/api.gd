class_name WayfarerApi
extends Node
## The HTTP API as functions. A server's /docs is its reference. Each is awaited and gives a Reply.

const ANSWER_SECONDS := 10.0
const PATIENCE_SECONDS := 15.0  # for which a refused call (429) is repeated
const PROTOCOL := "wayfarer.v1"


## The outcome of a call.
class Reply:
	var status := 0  ## of HTTP; 0: no answer
	var error := ""  ## what was wrong; "": nothing
	var data: Variant  ## the answer's JSON


## The server's address, as http://localhost:8080
var server := "http://localhost:8080":
	set(value):
		server = value
		homes = WayfarerHomes.new(value.trim_suffix("/"))
## The known nodes of a cluster.
var homes := WayfarerHomes.new("http://localhost:8080")
## API key or JWT, for a server that asks for one.
var token := ""


## A session in a scene, or with "" on an endless floor.
func create_session(lease_s: float, scene: String = "") -> Reply:
	var wanted := {"basis": "gltf", "lease_s": lease_s}
	if scene != "":
		wanted.scene = scene
	return await call_server(HTTPClient.METHOD_POST, "/v1/sessions", wanted)


func renew_session(session_id: String) -> Reply:
	return await call_server(HTTPClient.METHOD_POST, _path("sessions", session_id) + "/renew")


func delete_session(session_id: String) -> Reply:
	return await call_server(HTTPClient.METHOD_DELETE, _path("sessions", session_id))


## Create agents, all or none: `specs` as in POST /v1/sessions/…/agents.
func create_agents(session_id: String, specs: Array) -> Reply:
	var path := _path("sessions", session_id) + "/agents"
	return await call_server(HTTPClient.METHOD_POST, path, {"agents": specs})


func delete_agent(agent_id: String) -> Reply:
	return await call_server(HTTPClient.METHOD_DELETE, _path("agents", agent_id))


## Send an agent to places in turn. `goals` are those of PUT /v1/agents/…/path; see `goal`.
func set_path(agent_id: String, goals: Array) -> Reply:
	var path := _path("agents", agent_id) + "/path"
	return await call_server(HTTPClient.METHOD_PUT, path, {"goals": goals})


## Make an agent wander within some metres of a place. `how`: speed … of the API.
func wander(agent_id: String, centre: Vector3, radius: float, how: Dictionary = {}) -> Reply:
	var wanted := how.merged({"area": {"center": place(centre), "radius": radius}})
	var path := _path("agents", agent_id) + "/wander"
	return await call_server(HTTPClient.METHOD_PUT, path, wanted)


## Give an agent a behaviour: {"follow": {"agent_id": …}} … (docs/scenes.md).
func behave(agent_id: String, behaviour: Dictionary) -> Reply:
	var path := _path("agents", agent_id) + "/behaviour"
	return await call_server(HTTPClient.METHOD_PUT, path, behaviour)


func clear_goal(agent_id: String) -> Reply:
	return await call_server(HTTPClient.METHOD_DELETE, _path("agents", agent_id) + "/goal")


## Populate the session's scene with walking people.
func populate(session_id: String, count: int) -> Reply:
	var path := _path("sessions", session_id) + "/crowd"
	return await call_server(HTTPClient.METHOD_POST, path, {"count": count}, 60.0)


## Place or move an obstacle: {"box": …} … (docs/scenes.md).
func put_obstacle(scene_id: String, name_of: String, obstacle: Dictionary) -> Reply:
	var path := _path("scenes", scene_id) + "/obstacles/" + name_of.uri_encode()
	return await call_server(HTTPClient.METHOD_PUT, path, obstacle)


## The body whose bones are as long as a character's: `data` has gender and betas of an agent.
func fit_body(character: WayfarerCharacterJoints) -> Reply:
	var joints := []
	for bone in character.places:
		var at := place(character.places[bone])
		joints.append({"bone": WayfarerBones.NAMES[bone], "position": at})
	var wanted := {"joints": joints, "basis": "gltf"}
	if not is_nan(character.floor_height):
		wanted.floor = character.floor_height
	return await call_server(HTTPClient.METHOD_POST, "/v1/bodies:fit", wanted)


## Any call; it is repeated while the server is busy.
func call_server(
	method: HTTPClient.Method, path: String, body: Variant = null, seconds: float = ANSWER_SECONDS
) -> Reply:
	var patience := PATIENCE_SECONDS
	var route := WayfarerHomes.Route.new(homes, path)
	while true:
		var reply: Reply = await _ask(route.address, method, path, body, seconds)
		if reply.error == "":
			route.answered(_made(reply.data))
			return reply
		if route.refused(reply.status, reply.data) and is_inside_tree():
			continue
		var wait := 0.0
		if reply.status == 429 and reply.data is Dictionary:
			wait = reply.data.get("retry_after_s", 0.0)
		if wait <= 0.0 or wait > patience or not is_inside_tree():
			return reply
		patience -= wait
		await get_tree().create_timer(wait).timeout
	return null


## Where the stream connects. `wish`: encoding, fps … of the query of WS /v1/stream.
func stream_address(session_id: String, wish: Dictionary, resume_token: String) -> Dictionary:
	var query := "session=" + session_id.uri_encode()
	for key: String in wish:
		query += "&%s=%s" % [key, str(wish[key]).uri_encode()]
	if resume_token != "":
		query += "&resume_token=" + resume_token.uri_encode()
	var protocols := PackedStringArray([PROTOCOL])
	if token != "":
		var packed := Marshalls.utf8_to_base64(token)
		packed = packed.replace("+", "-").replace("/", "_").replace("=", "")
		protocols.append("wayfarer.token." + packed)
	var url := "ws" + homes.home(session_id).trim_prefix("http") + "/v1/stream?" + query
	return {"url": url, "protocols": protocols}


## A place in the form of the API.
static func place(at: Vector3) -> Dictionary:
	return {"x": at.x, "y": at.y, "z": at.z}


## A goal in the form of the API. `how`: its other fields, as {"speed": 1.4}.
static func goal(at: Vector3, how: Dictionary = {}) -> Dictionary:
	return how.merged({"position": place(at)})


func _ask(
	address: String, method: HTTPClient.Method, path: String, body: Variant, seconds: float
) -> Reply:
	var reply := Reply.new()
	var request := HTTPRequest.new()
	request.timeout = seconds
	add_child(request)
	var headers := PackedStringArray(["accept: application/json"])
	if token != "":
		headers.append("authorization: Bearer " + token)
	var text := ""
	if body != null:
		headers.append("content-type: application/json")
		text = JSON.stringify(body)
	var url := address + path
	var error := request.request(url, headers, method, text)
	if error != OK:
		reply.error = "%s: %s" % [url, error_string(error)]
		request.queue_free()
		return reply
	var answer: Array = await request.request_completed
	request.queue_free()
	if answer[0] != HTTPRequest.RESULT_SUCCESS:
		reply.error = "the server does not answer (%s, result %d)" % [address, answer[0]]
		return reply
	reply.status = answer[1]
	var said: String = answer[3].get_string_from_utf8()
	reply.data = JSON.parse_string(said) if said != "" else null
	if reply.status < 200 or reply.status > 299:
		reply.error = _refusal(reply)
	return reply


## The text of an RFC 9457 problem document with its fields, or the bare status.
static func _refusal(reply: Reply) -> String:
	var bare := "HTTP %d" % reply.status
	if not reply.data is Dictionary:
		return bare  # a proxy's page
	var fields := PackedStringArray()
	for wrong: Dictionary in reply.data.get("errors", []):
		fields.append("%s: %s" % [wrong.get("field", ""), wrong.get("detail", "")])
	if not fields.is_empty():
		return "; ".join(fields)
	return reply.data.get("detail", reply.data.get("title", bare))


## The id of the session or scene that an answer has created, or "".
static func _made(answer: Variant) -> String:
	return answer.get("session_id", answer.get("scene_id", "")) if answer is Dictionary else ""


static func _path(kind: String, id: String) -> String:
	return "/v1/%s/%s" % [kind, id.uri_encode()]
