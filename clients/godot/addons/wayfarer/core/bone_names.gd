class_name WayfarerBoneNames
extends RefCounted
## Written by `python -m tests.golden` from the Python client's bone_names.json.

const ROLES := {
	"hip": [
		"upleg",
		"upperleg",
		"legupper",
		"thigh",
		"femur",
		"hip"
	],
	"knee": [
		"lowerleg",
		"lowleg",
		"leglower",
		"calf",
		"shin",
		"knee",
		"leg"
	],
	"ankle": [
		"ankle",
		"foot"
	],
	"foot": [
		"toebase",
		"toe",
		"toes",
		"ball",
		"foot"
	],
	"shoulder": [
		"upperarm",
		"uparm",
		"armupper",
		"arm",
		"humerus",
		"shldr",
		"shoulder"
	],
	"collar": [
		"clavicle",
		"collar",
		"collarbone",
		"scapula",
		"shoulder"
	],
	"elbow": [
		"lowerarm",
		"forearm",
		"lowarm",
		"armlower",
		"elbow"
	],
	"wrist": [
		"hand",
		"wrist"
	],
	"pelvis": [
		"hips",
		"pelvis",
		"hip"
	],
	"neck": [
		"neck",
		"necklower"
	],
	"head": [
		"head"
	]
}
const LEFT := [
	"left",
	"l",
	"lf",
	"lft"
]
const RIGHT := [
	"right",
	"r",
	"rt",
	"rgt"
]
const NOISE := [
	"mixamorig",
	"bip",
	"cc",
	"base",
	"def",
	"j",
	"c",
	"b",
	"jnt",
	"joint",
	"bone",
	"bn",
	"armature",
	"character",
	"valvebiped",
	"rig"
]
const HELPERS := [
	"twist",
	"roll",
	"ik",
	"fk",
	"pole",
	"target",
	"end",
	"nub",
	"tip",
	"ctrl",
	"control",
	"helper",
	"socket",
	"effector",
	"share",
	"adj",
	"mch",
	"org",
	"weapon",
	"hair",
	"skirt",
	"breast",
	"eye",
	"eyelid",
	"jaw",
	"tongue",
	"teeth",
	"thumb",
	"index",
	"middle",
	"ring",
	"pinky",
	"little",
	"finger",
	"metacarpal",
	"heel"
]
const VRM_SPINE := [
	"spine",
	"chest",
	"upperChest"
]
const VRM := {
	"pelvis": "hips",
	"neck": "neck",
	"head": "head",
	"left_hip": "leftUpperLeg",
	"left_knee": "leftLowerLeg",
	"left_ankle": "leftFoot",
	"left_foot": "leftToes",
	"right_hip": "rightUpperLeg",
	"right_knee": "rightLowerLeg",
	"right_ankle": "rightFoot",
	"right_foot": "rightToes",
	"left_collar": "leftShoulder",
	"left_shoulder": "leftUpperArm",
	"left_elbow": "leftLowerArm",
	"left_wrist": "leftHand",
	"right_collar": "rightShoulder",
	"right_shoulder": "rightUpperArm",
	"right_elbow": "rightLowerArm",
	"right_wrist": "rightHand"
}
