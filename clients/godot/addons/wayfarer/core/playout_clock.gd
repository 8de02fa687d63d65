class_name WayfarerPlayoutClock
extends RefCounted
## Chooses the moment of the stream (server time) to show now, for all agents alike:
## clients/README.md, "Playout". Times are seconds; no clock is read.

const FIRST_DELAY := 0.35
const MIN_DELAY := 0.2
const MAX_DELAY := 1.5
const MARGIN := 0.06  # over the worst lateness of the window
const LATENESS_WINDOW := 20.0
const OFFSET_WINDOW := 30.0  # seconds; its fastest message counts as one without delay
const STRETCH := 0.05  # playback runs at most this much faster or slower
const JUMP := 1.0  # error in seconds beyond which it jumps instead (after a sleep)


## The minimum of the last seconds: candidates for it, rising from oldest to newest.
class WindowLeast:
	var seconds: float
	var _times := PackedFloat64Array()
	var _values := PackedFloat64Array()

	func _init(window: float) -> void:
		seconds = window

	func add(now: float, value: float) -> void:
		while not _values.is_empty() and _values[-1] >= value:
			_values.remove_at(_values.size() - 1)
			_times.remove_at(_times.size() - 1)
		_times.append(now)
		_values.append(value)

	## NAN when there is none.
	func least(now: float) -> float:
		while not _times.is_empty() and _times[0] < now - seconds:
			_times.remove_at(0)
			_values.remove_at(0)
		return NAN if _values.is_empty() else _values[0]


var _transit := WindowLeast.new(OFFSET_WINDOW)  # local - server time of each message
var _earliness := WindowLeast.new(LATENESS_WINDOW)  # of each chunk, negative when late
var _offset := NAN  # the last known least transit
var _playhead := NAN
var _last := 0.0
var _caught_up_at := -INF  # server time at which the stream was resumed last


## Note a message that came at local `now`, sent at server time `sent_at`.
func observe(now: float, sent_at: float) -> void:
	if is_nan(_offset):  # at first, expect as much as the first delay allows
		_earliness.add(now, MARGIN - FIRST_DELAY)
	_transit.add(now, now - sent_at)
	_offset = _transit.least(now)


## Note a chunk that came at local `now`, whose first frame is for `scheduled_at`.
func observe_chunk(now: float, scheduled_at: float) -> void:
	if scheduled_at >= _caught_up_at:
		_earliness.add(now, scheduled_at - server_time(now))


## Note that a connection was restored; its header was sent at server time `sent_at`. Chunks for
## earlier times were missed meanwhile; their lateness predicts nothing.
func resumed(sent_at: float) -> void:
	_caught_up_at = sent_at


## The server's clock at local `now`, as if the fastest message had taken no time.
func server_time(now: float) -> float:
	return now if is_nan(_offset) else now - _offset


## The target delay, seconds.
func wanted_delay(now: float) -> float:
	var least := _earliness.least(now)
	return MIN_DELAY if is_nan(least) else clampf(MARGIN - least, MIN_DELAY, MAX_DELAY)


## The present delay, seconds.
func delay(now: float) -> float:
	return wanted_delay(now) if is_nan(_playhead) else server_time(now) - _playhead


## Advance to local `now`; returns the moment to show, in server time.
func advance(now: float) -> float:
	if is_nan(_offset):
		return now  # nothing has come yet
	var ideal := server_time(now) - wanted_delay(now)
	if is_nan(_playhead) or absf(ideal - _playhead) > JUMP:
		_playhead = ideal
	else:
		var step := maxf(0.0, now - _last)
		var off := ideal - (_playhead + step)
		_playhead += step + clampf(off, -STRETCH * step, STRETCH * step)
	_last = now
	return _playhead
