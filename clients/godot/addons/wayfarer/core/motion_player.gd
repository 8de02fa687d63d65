class_name WayfarerMotionPlayer
extends RefCounted
## The agents of a stream, played smoothly: messages and times go in, poses come out. Times are
## seconds of any clock of this machine.

signal header_received(header: WayfarerStreamDecoder.Header, again: bool)
signal agent_added(played: PlayedAgent)
## Emitted also for an agent that has left the last ring and is `hidden`.
signal agent_removed(played: PlayedAgent)
signal chunk_received(played: PlayedAgent, chunk: WayfarerStreamDecoder.Chunk)
signal event_received(event: WayfarerStreamDecoder.MotionEvent)


## An agent as it is shown.
class PlayedAgent:
	var agent: WayfarerStreamDecoder.Agent
	var pose: WayfarerPose
	var track: WayfarerPoseTrack
	var shown := false  ## whether `pose` holds a pose
	var hidden := false  ## removed for having left the last ring; it may come again
	var tier := 0  ## number of its ring, from the last chunk
	var state := "standing"  ## from the last chunk

	func _init(introduced: WayfarerStreamDecoder.Agent, bones: int) -> void:
		agent = introduced
		pose = WayfarerPose.new(bones)
		track = WayfarerPoseTrack.new(bones)


var clock := WayfarerPlayoutClock.new()
var agents: Dictionary[int, PlayedAgent] = {}  ## by alias
var header: WayfarerStreamDecoder.Header
var moment := NAN  ## the one shown: server time, seconds since 1970
var error := ""  ## why a message could not be read
## Counts since the start; gaps, reduced and held count chunks with that flag.
var stats := {
	"messages": 0, "bytes": 0, "chunks": 0, "frames": 0, "gaps": 0, "reduced": 0, "held": 0
}

var _decoder := WayfarerStreamDecoder.new()
var _tiers: WayfarerTierUnpacker
var _gone_underruns := 0
var _begun := false


## The token from which the next stream resumes; "" at first.
func resume_token() -> String:
	return _decoder.resume_token


## How often an agent's frames ran out.
func underruns() -> int:
	var sum := _gone_underruns
	for played: PlayedAgent in agents.values():
		sum += played.track.underruns
	return sum


## Seconds of motion in the queue of the agent that has the least; INF without agents.
func buffered() -> float:
	var least := INF
	for played: PlayedAgent in agents.values():
		least = minf(least, played.track.buffered(moment))
	return least


## A connection begins: its first message is a header.
func begin() -> void:
	_begun = false


## Take a message of the stream (StreamMotionResponse) that came at local `now`. Returns its kind;
## "error": it cannot be read (`error` says why), and the connection is of no more use.
func receive(message: PackedByteArray, now: float) -> String:
	var kind := _decoder.decode(message)
	error = _decoder.error
	stats.messages += 1
	stats.bytes += message.size()
	if kind == "header":
		_take_header()
	elif kind == "batch" and not _begun:
		error = "motion came before the header"
	elif kind == "batch":
		error = _decoder.check_frames(header)
	if error != "":
		return "error"
	clock.observe(now, _decoder.sent_at)
	if kind == "batch":
		_take_batch(now)
	elif kind == "event":
		event_received.emit(_decoder.event)
	return kind


## Show all agents as at local `now`. Returns the moment shown, in server time.
func advance(now: float) -> float:
	moment = clock.advance(now)
	for played: PlayedAgent in agents.values():
		played.shown = played.track.sample(moment, played.pose)
	return moment


## Forget all agents, as if they were removed, and the clock.
func clear() -> void:
	for alias: int in agents.keys():
		remove(alias)
	clock = WayfarerPlayoutClock.new()


## Forget an agent.
func remove(alias: int) -> void:
	var played: PlayedAgent = agents.get(alias)
	if played == null:
		return
	_gone_underruns += played.track.underruns
	agents.erase(alias)
	agent_removed.emit(played)


func _take_header() -> void:
	var again := header != null
	var tiers := WayfarerTierUnpacker.new(_decoder.header)
	error = tiers.error  # an unknown encoding is an error at once
	if error != "":
		return
	_begun = true
	header = _decoder.header
	_tiers = tiers
	if again:
		clock.resumed(_decoder.sent_at)
	header_received.emit(header, again)


func _take_batch(now: float) -> void:
	var bones := header.bones.size()
	for agent in _decoder.added:
		_add(agent, bones)
	for row in _decoder.chunks:
		_take_chunk(_decoder.chunk(row), now)
	for alias in _decoder.removed:
		remove(alias)
	for alias in _decoder.hidden:
		if alias in agents:
			agents[alias].hidden = true
		remove(alias)


## A new agent, or a known one when a stream begins again.
func _add(agent: WayfarerStreamDecoder.Agent, bones: int) -> void:
	var known: PlayedAgent = agents.get(agent.alias)
	if known != null and known.agent.id == agent.id and known.track.bones() == bones:
		return
	remove(agent.alias)
	agents[agent.alias] = PlayedAgent.new(agent, bones)
	agent_added.emit(agents[agent.alias])


func _take_chunk(chunk: WayfarerStreamDecoder.Chunk, now: float) -> void:
	stats.chunks += 1
	stats.frames += chunk.frames
	stats.gaps += 1 if chunk.flags & WayfarerStreamDecoder.Flag.GAP else 0
	stats.reduced += 1 if chunk.flags & WayfarerStreamDecoder.Flag.REDUCED else 0
	stats.held += 1 if chunk.flags & WayfarerStreamDecoder.Flag.HELD else 0
	var played: PlayedAgent = agents.get(chunk.alias)
	if played == null:
		return  # removed here, its last chunks still on the way
	clock.observe_chunk(now, chunk.scheduled_at)
	var bytes := _decoder.bytes()
	var tier := _decoder.tier
	var poses := _tiers.unpack(bytes, chunk.poses, chunk.frames, tier)
	var fps := header.tiers[tier].sent_fps
	played.track.push(chunk.scheduled_at, fps, poses, bytes, chunk.contacts)
	played.state = chunk.state
	played.tier = tier
	chunk_received.emit(played, chunk)
