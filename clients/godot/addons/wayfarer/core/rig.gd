class_name WayfarerRig
extends RefCounted
## A character's nodes, parents before children, and where they are at rest in its own space.

## The error in the nodes; "": none.
var error := ""
var names: Array[String] = []
var parents := PackedInt32Array()
var children: Array[PackedInt32Array] = []
var rotations: Array[Quaternion] = []
var places := PackedVector3Array()
## Scales of the nodes by themselves.
var own_scales := PackedVector3Array()
## Products of scales from the top; right if each is equal along all axes.
var scales := PackedVector3Array()


## Add a node with its rest transform relative to its parent (its number, -1: none); returns its
## number.
func add(
	name: String,
	parent: int,
	position: Vector3 = Vector3.ZERO,
	rotation: Quaternion = Quaternion.IDENTITY,
	scale: Vector3 = Vector3.ONE
) -> int:
	var number := names.size()
	if parent < -1 or parent >= number:
		error = "node %d (%s): its parent must stand before it" % [number, name]
		parent = -1
	names.append(name)
	parents.append(parent)
	children.append(PackedInt32Array())
	own_scales.append(scale)
	var turn := rotation.normalized()
	if parent < 0:
		rotations.append(turn)
		places.append(position)
		scales.append(scale)
	else:
		children[parent].append(number)
		rotations.append(rotations[parent] * turn)
		places.append(places[parent] + rotations[parent] * (scales[parent] * position))
		scales.append(scales[parent] * scale)
	return number


## Ancestors of a node, from its parent to the top.
func ancestors(node: int) -> PackedInt32Array:
	var found := PackedInt32Array()
	var above := parents[node]
	while above >= 0:
		found.append(above)
		above = parents[above]
	return found


## A node and all below it, level by level.
func subtree(node: int) -> PackedInt32Array:
	var found := PackedInt32Array([node])
	var k := 0
	while k < found.size():
		found.append_array(children[found[k]])
		k += 1
	return found


## The nodes from a node down to a descendant.
func path(top: int, bottom: int) -> PackedInt32Array:
	var line := PackedInt32Array([bottom])
	while line[-1] != top:
		line.append(parents[line[-1]])
	line.reverse()
	return line


## The nodes of a line, without those nearer than `least` to the one kept before.
func joints(line: PackedInt32Array, least: float) -> PackedInt32Array:
	var found := PackedInt32Array()
	for k in line:
		if found.is_empty() or places[k].distance_to(places[found[-1]]) >= least:
			found.append(k)
	return found
