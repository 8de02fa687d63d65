class_name WayfarerSmoothRoot
extends RefCounted
## A smooth root for capsules, cameras and root motion, a point on the ground and a heading that do
## not sway with the hips: clients/README.md, "Smooth root".

const SMOOTHING := 0.3  # seconds: time constant of the critically damped filter
const JUMP := 2.0  # metres, or seconds between samples, beyond which it begins again at that place

## Point on the ground.
var point := Vector3.ZERO
## Radians, continuous beyond PI. NAN before the first update.
var heading: float:
	get:
		return _values[3]

var _basis: WayfarerBasis
var _jump: float
var _values := PackedFloat64Array([NAN, NAN, NAN, NAN])  # left, forward, up, heading
var _rates := PackedFloat64Array([0.0, 0.0, 0.0, 0.0])
var _last := NAN


func _init(basis: WayfarerBasis, metres_per_unit: float = 1.0) -> void:
	_basis = basis
	_jump = JUMP / metres_per_unit


## At `time`: place and rotation of the hips, height of the ground there.
func update(time: float, hips: Vector3, turn: Quaternion, ground: float) -> void:
	var step := 0.0 if is_nan(_last) else maxf(0.0, time - _last)
	_last = time
	var target := _basis.heading_of(turn)
	if not is_nan(heading):
		target += TAU * floorf((heading - target) / TAU + 0.5)
	_follow(0, hips.dot(_basis.left), step)
	_follow(1, hips.dot(_basis.forward), step)
	_follow(2, ground, step)
	_follow(3, target, step)
	point = _values[0] * _basis.left + _values[1] * _basis.forward + _values[2] * _basis.up


func _follow(k: int, target: float, step: float) -> void:
	var jumped := k < 3 and absf(target - _values[k]) > _jump
	if is_nan(_values[k]) or step > JUMP or jumped:
		_values[k] = target
		_rates[k] = 0.0
	elif step > 0.0:
		var theta := exp(-step / SMOOTHING)
		var ahead := _values[k] + _rates[k] * step
		var off := target - ahead
		_values[k] = ahead + (1.0 - theta * theta) * off
		_rates[k] += (1.0 - theta) * (1.0 - theta) / step * off
