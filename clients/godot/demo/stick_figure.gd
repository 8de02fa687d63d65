class_name WayfarerStickFigure
extends RefCounted
## A character without a file: a bar from each joint to the next. Its bones have the canonical
## names.

# each joint's place from its parent's, in a T-pose
const OFFSETS: Array[Vector3] = [
	Vector3(0.0, 0.918, 0.022),
	Vector3(0.103, -0.04, -0.006),
	Vector3(-0.103, -0.04, -0.006),
	Vector3(0.0, 0.116, -0.002),
	Vector3(0.0, -0.382, 0.0),
	Vector3(0.0, -0.382, 0.0),
	Vector3(0.0, 0.109, -0.005),
	Vector3(0.0, -0.416, 0.0),
	Vector3(0.0, -0.416, 0.0),
	Vector3(0.0, 0.117, -0.006),
	Vector3(0.0, -0.054, 0.141),
	Vector3(0.0, -0.054, 0.141),
	Vector3(0.0, 0.158, 0.009),
	Vector3(0.06, 0.131, 0.019),
	Vector3(-0.06, 0.131, 0.019),
	Vector3(0.0, 0.059, 0.018),
	Vector3(0.103, -0.064, 0.007),
	Vector3(-0.103, -0.064, 0.007),
	Vector3(0.256, 0.0, 0.0),
	Vector3(-0.256, 0.0, 0.0),
	Vector3(0.217, 0.0, 0.0),
	Vector3(-0.217, 0.0, 0.0),
]


## A new figure, which stands at the origin.
static func make(colour: Color) -> Node3D:
	var figure := Node3D.new()
	var skeleton := Skeleton3D.new()
	figure.add_child(skeleton)
	var material := StandardMaterial3D.new()
	material.albedo_color = colour
	for bone in WayfarerBones.COUNT:
		skeleton.add_bone(WayfarerBones.NAMES[bone])
		skeleton.set_bone_parent(bone, WayfarerBones.PARENTS[bone])
		skeleton.set_bone_rest(bone, Transform3D(Basis.IDENTITY, OFFSETS[bone]))
	skeleton.reset_bone_poses()
	for bone in range(1, WayfarerBones.COUNT):
		_add_bar(skeleton, WayfarerBones.PARENTS[bone], OFFSETS[bone], 0.05, material)
	_add_bar(skeleton, WayfarerBones.NAMES.find("head"), Vector3(0, 0.2, 0), 0.16, material)
	for side: String in ["left", "right"]:
		var toe := WayfarerBones.NAMES.find(side + "_foot")
		_add_bar(skeleton, toe, Vector3(0, 0, 0.07), 0.05, material)
	return figure


static func _add_bar(
	skeleton: Skeleton3D, bone: int, to: Vector3, thick: float, material: Material
) -> void:
	var joint := BoneAttachment3D.new()
	skeleton.add_child(joint)
	joint.bone_name = skeleton.get_bone_name(bone)
	var bar := MeshInstance3D.new()
	var box := BoxMesh.new()
	box.size = Vector3(thick, to.length(), thick)
	box.material = material
	bar.mesh = box
	bar.position = to / 2.0
	bar.quaternion = WayfarerRetarget.arc(Vector3.UP, to)
	joint.add_child(bar)
